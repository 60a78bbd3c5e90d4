#include "drivers/program/view/live_view.h"

#include <sys/resource.h>
#include <unistd.h>

#include "drivers/program/view/view_page.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kPoll = Span::from_milliseconds(25);
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr int kNiceness = 10;  // where the flight has no priority either, it still goes before its picture

}  // namespace

Result<std::unique_ptr<LiveView>> LiveView::open(const ViewAddress& address) {
  std::unique_ptr<LiveView> view(new LiveView);
  auto server =
      HttpServer::listen(address, [v = view.get()](const HttpRequest& request) { return v->answer(request); });
  if (!server) return server.error();
  view->server_ = std::move(*server);
  return view;
}

LiveView::~LiveView() {
  finish();
  closing_.store(true, std::memory_order_relaxed);  // nothing to be seen with it
  thread_.join();
}

bool LiveView::start(ViewSubject subject) {
  feed_.expect_images(subject.images);
  model_ = std::make_unique<ViewModel>(std::move(subject));
  last_asked_ns_ = monotonic_ns() - 1'000'000 * kMillisecond;
  return thread_.start({.name = "view", .stack_bytes = 512 * 1024}, serve, this);
}

void LiveView::serve(void* self) {
  LiveView& view = *static_cast<LiveView*>(self);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
  while (!view.closing_.load(std::memory_order_relaxed) || !view.may_close()) {
    view.server_->step(kPoll);
    view.fold();
  }
}

void LiveView::set_notes_of_receivers(const std::vector<std::string>& notes) {
  const std::lock_guard lock(notes_mutex_);
  if (notes_of_receivers_ != notes) notes_of_receivers_ = notes;
}

/// Takes in what the log thread has handed over.
void LiveView::fold() {
  const bool over = finished_.load(std::memory_order_acquire);  // before the look: all that came is found
  for (ViewedOutcome o; feed_.next(o);) model_->take(o);
  for (Publication l; feed_.next(l);) model_->take(l);
  for (Event e; feed_.next(e);) model_->take(e);
  model_->set_left_out(feed_.left_out());
  {
    const std::lock_guard lock(notes_mutex_);
    model_->set_notes_of_receivers(notes_of_receivers_);
  }
  if (image_.refresh()) model_->set_newest_image(image_.next_sequence());
  if (over) model_->finish();
  if (closing_since_ns_ == 0 && closing_.load(std::memory_order_relaxed)) closing_since_ns_ = monotonic_ns();
}

/// True if no page is open, or all open pages have been told that the flight has ended.
bool LiveView::may_close() const {
  if (closing_since_ns_ == 0) return false;
  const std::int64_t now_ns = monotonic_ns();
  if (now_ns - last_asked_ns_ > 2000 * kMillisecond || now_ns - closing_since_ns_ > 1500 * kMillisecond) return true;
  return told_end_ns_ != 0 && now_ns - told_end_ns_ > 300 * kMillisecond;  // the last image too
}

HttpResponse LiveView::answer(const HttpRequest& request) {
  if (request.path() == "/") return page_answer(kViewPage);
  if (request.path() == "/state") return state(request);
  fold();
  return image_.answer(request.path());
}

HttpResponse LiveView::state(const HttpRequest& request) {
  last_asked_ns_ = monotonic_ns();
  feed_.note_viewer(last_asked_ns_);
  fold();
  if (model_->finished() && told_end_ns_ == 0) told_end_ns_ = last_asked_ns_;
  return {200, "application/json",
          model_->state_json({request.number("generation", 0), request.number("path", 0), request.number("sample", 0),
                              request.number("event", 0)}),
          ""};
}

}  // namespace epiline
