// Any bytes as a configuration: taken or refused. What is taken, written out and read again, is the same configuration.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "pipeline/config/config.h"

using epiline::Config;
using epiline::ConfigFile;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = ConfigFile::parse(std::string_view(reinterpret_cast<const char*>(data), size), "input");
  if (!file) return file.error().text().empty() ? (std::abort(), 1) : 0;
  Config config;
  file->apply(config);
  const std::string written = to_toml(config);
  const auto again = ConfigFile::parse(written, "output");
  if (!again) std::abort();
  Config same;
  again->apply(same);
  if (to_toml(same) != written) std::abort();
  return 0;
}
