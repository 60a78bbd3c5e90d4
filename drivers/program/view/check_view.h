#pragma once
// Serves the page of `epiline check --view`: docs/devices.md.
#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "drivers/program/check/check.h"
#include "drivers/program/check/spectrum.h"
#include "drivers/program/view/http_server.h"
#include "drivers/program/view/view_answers.h"
#include "drivers/program/view/view_feed.h"

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

/// One thread serves the page; the threads of the check pass their data to it.
class CheckView final : public CheckWitness {
 public:
  /// Writes a setting into the configuration.
  using Accept = std::function<Status(const SettingHint&)>;

  /// Listens. Fails if and only if the address cannot be had. Settings may be accepted on this computer alone: on other
  /// interfaces anybody could.
  static Result<std::unique_ptr<CheckView>> open(const ViewAddress& address, CheckSubject subject, Accept accept);
  /// Open pages get a second to show that the check has ended.
  ~CheckView() override;
  CheckView(const CheckView&) = delete;
  CheckView& operator=(const CheckView&) = delete;

  /// With the port that was really taken.
  const ViewAddress& address() const { return server_->address(); }

  void image(const Frame& frame, const TrackedFrame& tracked, double edge_px) override;
  void reading(const ImuSample& sample) override;
  void findings(double seconds, const Findings& findings) override;
  bool takes_new_start() override { return new_start_.exchange(false); }

 private:
  static constexpr double kShown_s = 30, kPaced_s = 3;
  struct Sight {
    HostStamp stamp;
    double edge_px = 0;
    std::size_t tracks = 0;
  };
  /// What was seen since the beginning, or since the page asked to begin again.
  struct Seen {
    std::deque<Sight> sights;        ///< of the last kShown_s
    std::deque<HostStamp> readings;  ///< of the last kPaced_s
    SpectrumWindow spectrum;
    std::array<double, 3> turned{};  ///< sum of all turns about each axis, rad
  };

  CheckView(CheckSubject subject, Accept accept);
  void serve();
  HttpResponse answer(const HttpRequest& request);
  HttpResponse post(const HttpRequest& request);
  HttpResponse accept(std::string_view setting);
  std::string state_json() const;

  const CheckSubject subject_;
  const Accept accept_;
  const std::string key_;  ///< that a POST must carry
  std::unique_ptr<HttpServer> server_;
  ViewFeed feed_;  ///< filled by the camera's thread, read by the serving one
  ServedImage image_{feed_};
  std::atomic<bool> new_start_{false}, closing_{false};
  std::mutex mutex_;
  // Under mutex_.
  Seen seen_;
  ImuSample newest_;
  Findings findings_;
  double seconds_ = 0;
  std::set<std::string> accepted_;  ///< settings
  std::vector<std::string> notes_;  ///< of settings that were written, and of errors of writing them
  std::thread thread_;              // last: it uses the others
};

}  // namespace epiline
