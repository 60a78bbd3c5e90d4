#pragma once
// Serves the page of `epiline check --view`: docs/devices.md.
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "drivers/program/view/check_model.h"
#include "drivers/program/view/http_server.h"
#include "drivers/program/view/view_answers.h"
#include "drivers/program/view/view_feed.h"

namespace epiline {

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
  CheckView(CheckSubject subject, Accept accept);
  void serve();
  HttpResponse answer(const HttpRequest& request);
  HttpResponse post(const HttpRequest& request);
  HttpResponse accept(std::string_view setting);

  const Accept accept_;
  const std::string key_;  ///< that a POST must carry
  std::unique_ptr<HttpServer> server_;
  std::mutex mutex_;
  CheckModel model_;  ///< under mutex_
  ViewFeed feed_;     ///< filled by the camera's thread, read by the serving one
  ServedImage image_{feed_};
  std::atomic<bool> new_start_{false}, closing_{false};
  std::thread thread_;  // last: it uses the others
};

}  // namespace epiline
