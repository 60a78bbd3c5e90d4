#include "drivers/program/bench/board.h"

#include <sched.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>

namespace epiline {
namespace {

std::string first_line_of(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  line.erase(std::remove(line.begin(), line.end(), '\0'), line.end());  // device trees end their texts with one
  return line;
}

/// The file's number, which is in thousandths: of a degree, of a MHz.
std::optional<double> thousandths_in(const std::filesystem::path& path) {
  const std::string line = first_line_of(path);
  char* end = nullptr;
  const double value = std::strtod(line.c_str(), &end);
  return end == line.c_str() ? std::nullopt : std::optional(1e-3 * value);
}

/// ARM's numbers of processors, in Linux' words.
std::string arm_processor(const std::string& part) {
  constexpr std::array<std::array<const char*, 2>, 6> kParts{{{"0xd03", "Cortex-A53"},
                                                              {"0xd05", "Cortex-A55"},
                                                              {"0xd08", "Cortex-A72"},
                                                              {"0xd0b", "Cortex-A76"},
                                                              {"0xd41", "Cortex-A78"},
                                                              {"0xd42", "Cortex-A78AE"}}};
  for (const auto& [number, name] : kParts)
    if (part == number) return name;
  return "ARM " + part;
}

}  // namespace

std::string board_name(const std::filesystem::path& root) {
  std::string names = first_line_of(root / "proc/device-tree/model");
  std::ifstream cpuinfo(root / "proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    const bool is_arm = line.rfind("CPU part", 0) == 0;
    if (!is_arm && line.rfind("model name", 0) != 0) continue;
    const std::string value = line.substr(line.find(": ") + 2), name = is_arm ? arm_processor(value) : value;
    if (names.find(name) == std::string::npos) names += (names.empty() ? "" : ", ") + name;
  }
  return names.empty() ? "unknown computer" : names;
}

BoardState board_state(const std::filesystem::path& root) {
  BoardState state;
  std::error_code ignored;
  for (const auto& zone : std::filesystem::directory_iterator(root / "sys/class/thermal", ignored)) {
    const auto celsius = thousandths_in(zone.path() / "temp");
    if (celsius) state.hottest_c = std::max(*celsius, state.hottest_c.value_or(*celsius));
  }
  const auto clock = root / ("sys/devices/system/cpu/cpu" + std::to_string(sched_getcpu())) / "cpufreq";
  state.clock_mhz = thousandths_in(clock / "scaling_cur_freq");
  state.full_clock_mhz = thousandths_in(clock / "cpuinfo_max_freq");
  const std::string flags = first_line_of(root / "sys/devices/platform/soc/soc:firmware/get_throttled");
  if (!flags.empty()) state.throttled = std::strtoul(flags.c_str(), nullptr, 16);
  return state;
}

std::string throttling_text(const std::optional<unsigned long>& flags) {
  if (!flags) return "not known";
  // bits of the firmware: now; 16 bits higher: since the computer was switched on
  constexpr std::array kNames{"under-voltage", "clock limited", "throttled", "too hot"};
  std::string text;
  for (std::size_t bit = 0; bit < kNames.size(); ++bit) {
    const bool now = (*flags >> bit & 1) != 0, before = (*flags >> (bit + 16) & 1) != 0;
    if (now || before) text += (text.empty() ? "" : ", ") + std::string(kNames[bit]) + (now ? " now" : " earlier");
  }
  return text.empty() ? "none" : text;
}

}  // namespace epiline
