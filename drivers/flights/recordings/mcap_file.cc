// MCAP: records of a kind, a length and content; chunks hold further records. The summary behind the data is not
// needed.
#include <zlib.h>

#include <algorithm>
#include <map>
#include <string>
#include <string_view>

#include "drivers/flights/recordings/bag_reader.h"
#include "drivers/flights/recordings/byte_reader.h"
#include "drivers/flights/recordings/mcap_records.h"

namespace epiline {

namespace {

constexpr std::uint64_t kRecordHead = 1 + 8;

Packing mcap_packing(std::string_view name) {
  if (name.empty() || name == "none") return Packing::kNone;
  if (name == "lz4") return Packing::kLz4;
  return name == "zstd" ? Packing::kZstd : Packing::kUnknown;
}

class McapFile final : public RecordFile {
 public:
  using RecordFile::RecordFile;

  Status scan(const See& see) override {
    Bytes head, content;
    for (std::uint64_t at = kMcapMagic.size();;) {
      const std::uint64_t begin = at;
      if (!file().read(at, kRecordHead, head)) return ends_early(begin);
      ByteReader in(head);
      const auto op = in.number<std::uint8_t>();
      const auto size = in.number<std::uint64_t>();
      at += kRecordHead;
      if (op == kMcapDataEnd || op == kMcapFooter) return Done{};
      if (!file().holds(at, size)) return ends_early(begin);
      if (op == kMcapChunk) {
        if (const Status s = scan_chunk(at, size, see); !s) return s;
      } else if (op == kMcapSchema || op == kMcapChannel || op == kMcapMessage) {
        if (!file().read(at, size, content)) return ends_early(begin);
        if (!take(op, content, {0, 0, at, size}, see)) return damaged(begin, "an incomplete record");
      }
      at += size;
    }
  }

 private:
  Status scan_chunk(std::uint64_t at, std::uint64_t size, const See& see) {
    constexpr std::uint64_t kMostOfHead = 8 + 8 + 8 + 4 + 4 + 32 + 8;
    Bytes head;
    if (!file().read(at, std::min(size, kMostOfHead), head)) return damaged(at, "a chunk that cannot be read");
    ByteReader in(head);
    in.take(8 + 8);  // first and last time
    const auto unpacked = in.number<std::uint64_t>();
    const auto sum = in.number<std::uint32_t>();
    const std::string name(in.text());
    const auto packed = in.number<std::uint64_t>();
    if (!in.good() || packed > size - in.at()) return damaged(at, "an incomplete chunk");
    const Packing packing = mcap_packing(name);
    if (packing == Packing::kUnknown) return damaged(at, "a chunk with the compression \"" + name + "\"");
    if (packed == 0 && unpacked == 0) return Done{};
    const std::uint64_t records = at + in.at();
    const auto bytes = open_chunk({records, packed, unpacked, packing});
    if (!bytes) return bytes.error();
    if (sum != 0 && crc32(0, bytes->data(), static_cast<uInt>(bytes->size())) != sum)
      return damaged(at, "a chunk with a wrong checksum");
    return scan_records(*bytes, packing == Packing::kNone ? records : 0, packing == Packing::kNone ? 0 : chunks(), see);
  }

  Status scan_records(std::span<const std::uint8_t> bytes, std::uint64_t base, std::uint32_t chunk, const See& see) {
    for (ByteReader in(bytes); in.left() > 0;) {
      const auto op = in.number<std::uint8_t>();
      const auto content = in.block<std::uint64_t>();
      if (!in.good() || !take(op, content, {0, chunk, base + in.at() - content.size(), content.size()}, see))
        return damaged(base, "an incomplete record in a chunk");
    }
    return Done{};
  }

  /// False if the record lacks something. `place`: of its content.
  bool take(std::uint8_t op, std::span<const std::uint8_t> content, const BagPlace& place, const See& see) {
    ByteReader in(content);
    if (op == kMcapSchema) {
      const auto id = in.number<std::uint16_t>();
      schemas_[id] = in.text();
    } else if (op == kMcapChannel) {
      const auto id = in.number<std::uint16_t>(), schema = in.number<std::uint16_t>();
      const std::string topic(in.text()), encoding(in.text());
      if (in.good()) topic_of_[id] = add_topic({topic, schemas_[schema], encoding});
    } else if (op == kMcapMessage) {
      const auto channel = in.number<std::uint16_t>();
      in.take(4);  // sequence number
      const auto recorded = in.number<std::uint64_t>();
      in.take(8);  // when it was sent
      const auto topic = topic_of_.find(channel);
      if (!in.good() || topic == topic_of_.end()) return false;
      see({topic->second,
           static_cast<std::int64_t>(recorded),
           content.subspan(in.at()),
           {0, place.chunk, place.offset + in.at(), place.size - in.at()}});
    }
    return in.good();
  }

  std::map<std::uint16_t, std::string> schemas_;
  std::map<std::uint16_t, std::size_t> topic_of_;  ///< by channel
};

}  // namespace

std::unique_ptr<BagReader> mcap_reader(const std::filesystem::path& path) { return std::make_unique<McapFile>(path); }

}  // namespace epiline
