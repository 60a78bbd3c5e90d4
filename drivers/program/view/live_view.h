#pragma once
// Serves a page that shows a running flight in a browser: docs/fly.md.
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/program/view/http_server.h"
#include "drivers/program/view/view_answers.h"
#include "drivers/program/view/view_feed.h"
#include "drivers/program/view/view_model.h"
#include "platform/linux/realtime.h"

namespace epiline {

/// One thread without priority serves the page; its data comes through observer().
class LiveView final : public FlightView {
 public:
  /// Listens; browsers may connect, and are answered from start() on. Fails if and only if the address cannot be had.
  static Result<std::unique_ptr<LiveView>> open(const ViewAddress& address);
  /// Ends the thread; open pages get up to 1.5 s to show that the flight has ended.
  ~LiveView() override;
  LiveView(const LiveView&) = delete;
  LiveView& operator=(const LiveView&) = delete;

  /// With the port that was really taken.
  const ViewAddress& address() const { return server_->address(); }
  bool start(ViewSubject subject) override;
  FlightObserver& observer() override { return feed_; }
  /// What receivers of the odometry say now, a sentence each. Any thread.
  void set_notes_of_receivers(const std::vector<std::string>& notes);
  void finish() override { finished_.store(true, std::memory_order_release); }  // pairs with the acquire in fold()

 private:
  LiveView() = default;
  static void serve(void* self);
  void fold();
  bool may_close() const;
  HttpResponse answer(const HttpRequest& request);
  HttpResponse state(const HttpRequest& request);

  std::unique_ptr<HttpServer> server_;
  ViewFeed feed_;
  RealtimeThread thread_;
  std::atomic<bool> finished_{false}, closing_{false};
  std::mutex notes_mutex_;
  std::vector<std::string> notes_of_receivers_;

  // The serving thread's own.
  std::unique_ptr<ViewModel> model_;
  ServedImage image_{feed_};
  std::int64_t last_asked_ns_ = 0, told_end_ns_ = 0, closing_since_ns_ = 0;
};

}  // namespace epiline
