// Any bytes as a bag: a ROS 1 bag, an MCAP file or a ROS 2 bag in SQLite, known by their first bytes. Read or refused;
// each message can be read again and is the same; no more memory is taken than the bytes account for.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "drivers/flights/recordings/bag.h"
#include "tests/fuzz/scratch_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("bag_fuzz");
  const auto path = folder.path() / "any.bag";
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  auto bag = epiline::Bag::open(path);
  if (!bag) return bag.error().text().find("any.bag") == std::string::npos ? (std::abort(), 1) : 0;
  struct Seen {
    epiline::BagPlace place;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<Seen> seen;
  const auto scanned = (*bag)->scan([&](const epiline::BagMessage& message) {
    if (message.topic >= (*bag)->topics().size()) std::abort();
    if (seen.size() < 64) seen.push_back({message.place, {message.bytes.begin(), message.bytes.end()}});
  });
  (void)scanned;
  for (const Seen& message : seen) {
    const auto again = (*bag)->read(message.place);
    if (again && !std::equal(again->begin(), again->end(), message.bytes.begin(), message.bytes.end())) std::abort();
  }
  return 0;
}
