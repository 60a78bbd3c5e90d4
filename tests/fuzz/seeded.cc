// A short run of a fuzz target for the ordinary tests: every file of its corpus, then inputs made of them by random
// changes, always the same ones. No coverage guides it (`./run fuzz` does that); it costs no build of its own. The
// input that ended the program is left in NAME.input. usage: seeded_NAME CORPUS NAME INPUTS SECONDS   (ends after so
// many inputs, or as many seconds)
#include <fcntl.h>
#include <sanitizer/common_interface_defs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr std::size_t kLongest = 4096;

Bytes current;     // NOLINT: what the signal handler leaves behind
std::string name;  // NOLINT

void leave_input() {
  const int file = open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file < 0) return;
  (void)!write(file, current.data(), current.size());
  close(file);
}

// In memory of just its size, so that a byte read behind its end is seen; the address of nothing is still an address.
void run(const Bytes& input) {
  static const std::uint8_t nothing = 0;
  current = Bytes(input.begin(), input.end());
  LLVMFuzzerTestOneInput(current.empty() ? &nothing : current.data(), current.size());
}

class Changes {
 public:
  explicit Changes(std::vector<Bytes> corpus) : corpus_(std::move(corpus)) {}

  Bytes next() {
    Bytes input = any();
    for (std::size_t i = 1 + below(6); i > 0; --i) change(input);
    if (input.size() > kLongest) input.resize(kLongest);
    return input;
  }

 private:
  std::size_t below(std::size_t n) { return n == 0 ? 0 : random_() % n; }
  const Bytes& any() { return corpus_[below(corpus_.size())]; }

  void change(Bytes& b) {
    constexpr std::array<std::uint8_t, 12> kEdges = {0, 1, 0x7f, 0x80, 0xff, '\n', ',', '[', '&', '*', '-', '9'};
    const std::size_t at = below(b.size() + 1), length = 1 + below(16), end = std::min(b.size(), at + length);
    const auto here = b.begin() + static_cast<std::ptrdiff_t>(at), there = b.begin() + static_cast<std::ptrdiff_t>(end);
    switch (below(6)) {
      case 0:  // a bit
        if (at < b.size()) b[at] ^= static_cast<std::uint8_t>(1U << below(8));
        break;
      case 1:  // a byte that means something
        if (at < b.size()) b[at] = kEdges[below(kEdges.size())];
        break;
      case 2:  // less
        b.erase(here, there);
        break;
      case 3: {  // the same twice
        const Bytes piece(here, there);
        b.insert(here, piece.begin(), piece.end());
        break;
      }
      case 4: {  // anything
        Bytes noise(length);
        for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(below(256));
        b.insert(here, noise.begin(), noise.end());
        break;
      }
      default: {  // the end of another
        const Bytes& other = any();
        b.resize(at);
        b.insert(b.end(), other.begin() + static_cast<std::ptrdiff_t>(below(other.size() + 1)), other.end());
      }
    }
  }

  std::vector<Bytes> corpus_;
  std::mt19937_64 random_{1};
};

std::vector<Bytes> read_corpus(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(folder)) {
    for (const auto& file : std::filesystem::directory_iterator(folder)) files.push_back(file.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Bytes> corpus(1);  // nothing at all is an input too
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return corpus;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  name = std::string(argv[2]) + ".input";
  __sanitizer_set_death_callback(leave_input);
  std::signal(SIGABRT, [](int) { leave_input(); });
  const std::vector<Bytes> corpus = read_corpus(argv[1]);
  for (const Bytes& input : corpus) run(input);
  Changes changes(corpus);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atoi(argv[4]));
  long inputs = 0;
  for (const long most = std::atol(argv[3]); inputs < most && std::chrono::steady_clock::now() < end; ++inputs)
    run(changes.next());
  std::printf("%zu files, %ld inputs made of them\n", corpus.size() - 1, inputs);
  return 0;
}
