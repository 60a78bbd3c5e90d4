#pragma once
// Lines of the kernel's gpio-sim, and the hand that moves them.
#include <filesystem>
#include <string>
#include <vector>

#include "tests/hardware/support.h"

namespace epiline {

/// A chip whose lines have these names; its label is `label`.
class SimulatedGpio {
 public:
  SimulatedGpio(const std::string& label, const std::vector<std::string>& names)
      : folder_("/sys/kernel/config/gpio-sim/" + label) {
    std::filesystem::create_directories(folder_ + "/bank");
    write_file(folder_ + "/bank/num_lines", std::to_string(names.size()));
    write_file(folder_ + "/bank/label", label);
    for (std::size_t i = 0; i < names.size(); ++i) {
      lines_.push_back(folder_ + "/bank/line" + std::to_string(i));
      std::filesystem::create_directory(lines_.back());
      if (!names[i].empty()) write_file(lines_.back() + "/name", names[i]);
    }
    plug_in();
  }
  ~SimulatedGpio() {
    if (!is_gone_) unplug();
    for (const std::string& line : lines_) std::filesystem::remove(line);
    std::filesystem::remove(folder_ + "/bank");
    std::filesystem::remove(folder_);
  }
  void plug_in() {
    write_file(folder_ + "/live", "1");
    chip_ = first_line(folder_ + "/bank/chip_name");
    device_ = "/sys/devices/platform/" + first_line(folder_ + "/dev_name") + "/" + chip_;
    is_gone_ = false;
  }
  void unplug() {
    write_file(folder_ + "/live", "0");
    is_gone_ = true;
  }
  const std::string& chip() const { return chip_; }
  void set(int line, bool high) const {
    write_file(device_ + "/sim_gpio" + std::to_string(line) + "/pull", high ? "pull-up" : "pull-down");
  }

  /// The kernel stamped an edge between these two instants.
  struct Between {
    std::int64_t begin_ns = 0, end_ns = 0;
  };
  Between edge(int line, bool high) const {
    Between between;
    between.begin_ns = monotonic_ns();
    set(line, high);
    between.end_ns = monotonic_ns();
    return between;
  }

 private:
  std::string folder_, chip_, device_;
  std::vector<std::string> lines_;
  bool is_gone_ = false;
};

}  // namespace epiline
