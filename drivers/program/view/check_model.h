#pragma once
// The state of the page of `epiline check --view`: collected from a check, returned as JSON. One thread at a time.
#include <array>
#include <cstdint>
#include <deque>
#include <set>
#include <string>
#include <vector>

#include "drivers/program/check/check_witness.h"
#include "drivers/program/check/spectrum.h"
#include "platform/error/result.h"

namespace epiline {

/// Properties that do not change while the page is served.
struct CheckSubject {
  std::string title;                                        ///< the configuration's name
  std::string program;                                      ///< name and version
  double gyroscope_density = 0, accelerometer_density = 0;  ///< configured, per sqrt(Hz)
  bool may_accept = false;  ///< findings may be written into the configuration from the page
};

/// The setting's name as `--set` takes it: "camera.time_offset_s".
inline std::string name_of(const SettingHint& hint) { return hint.section + "." + hint.key; }

class CheckModel {
 public:
  explicit CheckModel(CheckSubject subject) : subject_(std::move(subject)) {}

  void take(const Frame& frame, const TrackedFrame& tracked, double edge_px);
  void take(const ImuSample& sample);
  void take(double seconds, const Findings& findings);
  void set_newest_image(std::uint64_t next_sequence) { newest_image_ = next_sequence; }
  /// Notes that a setting was written into the configuration, or the error of writing it.
  void note_accepted(const SettingHint& hint, const Status& written);
  void finish() { finished_ = true; }
  bool finished() const { return finished_; }
  /// Discards images and samples; accepted settings stay.
  void forget();

  const Findings& findings() const { return findings_; }
  /// The answer to `/state`.
  std::string state_json() const;

 private:
  static constexpr double kShown_s = 30, kPaced_s = 3;
  struct Sight {
    HostStamp stamp;
    double edge_px = 0;
    std::size_t tracks = 0;
  };

  CheckSubject subject_;
  std::deque<Sight> sights_;        ///< of the last kShown_s
  std::deque<HostStamp> readings_;  ///< of the last kPaced_s
  SpectrumWindow spectrum_;
  std::array<double, 3> rate_{}, turned_{};  ///< newest, rad/s; sum of all turns about each axis, rad
  std::array<double, 3> force_{};
  Findings findings_;
  std::set<std::string> accepted_;
  std::vector<std::string> notes_;
  double seconds_ = 0;
  std::uint64_t newest_image_ = 0;
  bool finished_ = false;
};

}  // namespace epiline
