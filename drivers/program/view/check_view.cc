#include "drivers/program/view/check_view.h"

#include <fmt/format.h>

#include <cmath>

#include "drivers/program/check/pacing.h"
#include "drivers/program/view/view_address.h"
#include "drivers/program/view/view_page.h"
#include "drivers/study/report/errors_json.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kCheckPoll = Span::from_milliseconds(25);
constexpr const char* kKeyHeader = "X-Epiline-Key";
constexpr double kSlowTurn = 0.15;  // rad/s: less may be a bias
constexpr double kLongestStep_s = 0.1;

template <class Stamps, class StampOf>
Json pace_json(const Stamps& stamps, double seconds, StampOf stamp_of) {
  Pacing pacing;
  for (const auto& s : stamps)
    if ((stamp_of(stamps.back()) - stamp_of(s)).seconds() <= seconds) pacing.step(stamp_of(s), {});
  const PacingResult p = pacing.result();
  return {{"hz", p.rate_hz()}, {"jitter_ms", 1e3 * p.jitter_s}, {"period_ms", 1e3 * p.period_s}};
}

/// The strongest oscillation, for words: Hz; 0: none that is faster than a hand.
double peak_hz(const std::vector<double>& density, double step_hz) {
  double strongest = 0, at_hz = 0;
  for (std::size_t i = 0; i < density.size(); ++i) {
    const double hz = step_hz * static_cast<double>(i + 1);
    if (hz < kFasterThanAHand_hz || density[i] <= strongest) continue;
    strongest = density[i];
    at_hz = hz;
  }
  return at_hz;
}

}  // namespace

CheckView::CheckView(CheckSubject subject, Accept accept)
    : subject_(std::move(subject)), accept_(std::move(accept)), key_(new_token()) {}

Result<std::unique_ptr<CheckView>> CheckView::open(const ViewAddress& address, CheckSubject subject, Accept accept) {
  subject.may_accept = address.is_loopback() && accept != nullptr;
  const HttpPosts posts = address.is_loopback() ? HttpPosts::kWithoutBody : HttpPosts::kRefused;
  std::unique_ptr<CheckView> view(new CheckView(std::move(subject), std::move(accept)));
  auto server = HttpServer::listen(
      address, [v = view.get()](const HttpRequest& request) { return v->answer(request); }, posts);
  if (!server) return server.error();
  view->server_ = std::move(*server);
  view->feed_.expect_images(true);
  view->thread_ = std::thread([v = view.get()] { v->serve(); });
  return view;
}

CheckView::~CheckView() {
  closing_ = true;
  if (thread_.joinable()) thread_.join();
}

void CheckView::serve() {
  constexpr std::int64_t kToSayTheEnd_ns = 1'000'000'000;
  std::int64_t closing_since_ns = 0;
  while (closing_since_ns == 0 || (server_->connections() > 0 && monotonic_ns() - closing_since_ns < kToSayTheEnd_ns)) {
    if (closing_ && closing_since_ns == 0) closing_since_ns = monotonic_ns();
    server_->step(kCheckPoll);
  }
}

void CheckView::image(const Frame& frame, const TrackedFrame& tracked, double edge_px) {
  LoggedTracks tracks;
  tracks.sequence = frame.sequence;
  tracks.stamp = frame.stamp;
  for (const TrackedFeature& f : tracked.features) tracks.points.push_back({f.id, f.age, f.pixel[0], f.pixel[1]});
  feed_.tracks(tracks);
  feed_.image(frame, {});
  const std::lock_guard lock(mutex_);
  auto& sights = seen_.sights;
  if (!sights.empty() && frame.stamp <= sights.back().stamp) return;
  sights.push_back({frame.stamp, edge_px, tracked.features.size()});
  while ((frame.stamp - sights.front().stamp).seconds() > kShown_s) sights.pop_front();
}

void CheckView::reading(const ImuSample& sample) {
  const std::lock_guard lock(mutex_);
  auto& readings = seen_.readings;
  if (!readings.empty()) {
    const double step_s = (sample.stamp - readings.back()).seconds();
    if (!(step_s > 0)) return;
    for (std::size_t i = 0; i < 3; ++i) {
      const double w = std::abs(sample.angular_velocity_rad_s[i]);
      if (w > kSlowTurn && step_s < kLongestStep_s) seen_.turned[i] += w * step_s;
    }
  }
  newest_ = sample;
  readings.push_back(sample.stamp);
  while ((sample.stamp - readings.front()).seconds() > kPaced_s) readings.pop_front();
  seen_.spectrum.step(sample);
}

void CheckView::findings(double seconds, const Findings& findings) {
  const std::lock_guard lock(mutex_);
  seconds_ = seconds;
  findings_ = findings;
}

HttpResponse CheckView::answer(const HttpRequest& request) {
  if (request.is_post()) return post(request);
  if (request.path() == "/") {
    HttpResponse page = page_answer(kCheckPage);
    const std::string_view mark = "@KEY@";
    if (const std::size_t at = page.body.find(mark); at != std::string::npos) page.body.replace(at, mark.size(), key_);
    return page;
  }
  image_.refresh();
  if (request.path() != "/state") return image_.answer(request.path());
  feed_.note_viewer(monotonic_ns());
  const std::lock_guard lock(mutex_);
  return {200, "application/json", state_json(), ""};
}

HttpResponse CheckView::post(const HttpRequest& request) {
  if (request.header(kKeyHeader) != key_) return {403, "text/plain", "only the page itself may ask for that\n", ""};
  if (request.path() == "/accept") return accept(request.text("setting"));
  if (request.path() == "/again") {
    const std::lock_guard lock(mutex_);
    seen_ = {};
    new_start_ = true;
    return {200, "text/plain", "begun anew\n", ""};
  }
  return {404, "text/plain", "there are /accept and /again\n", ""};
}

/// By its name: findings may have moved since the page was drawn.
HttpResponse CheckView::accept(std::string_view setting) {
  constexpr std::size_t kMostNotes = 20;
  const std::lock_guard lock(mutex_);
  for (const Finding& f : findings_) {
    if (f.hint.key.empty() || name_of(f.hint) != setting) continue;
    const Status written = accept_(f.hint);
    if (written) accepted_.insert(name_of(f.hint));
    if (notes_.size() >= kMostNotes) notes_.erase(notes_.begin());
    notes_.push_back(
        written ? fmt::format("{} = {:.6g} is in the configuration; the check uses it when it is started again",
                              name_of(f.hint), f.hint.value)
                : "not written: " + written.error().text());
    return {written ? 200 : 500, "text/plain", written ? "set\n" : written.error().text() + "\n", ""};
  }
  return {404, "text/plain", "no finding would set that\n", ""};
}

/// The answer to `/state`.
std::string CheckView::state_json() const {
  const auto& sights = seen_.sights;
  Json root{{"schema", 1},
            {"title", subject_.title},
            {"program", subject_.program},
            {"finished", closing_.load()},
            {"seconds", seconds_},
            {"image", image_.next_sequence()},
            {"may_accept", subject_.may_accept}};
  Json& findings = root["findings"] = Json::array();
  for (const Finding& f : findings_) {
    const bool has_hint = !f.hint.key.empty() && accepted_.count(name_of(f.hint)) == 0;
    findings.push_back({{"grade", kGradeNames[static_cast<std::size_t>(f.grade)]},
                        {"device", f.device},
                        {"text", f.text},
                        {"remedy", f.remedy},
                        {"setting", has_hint ? Json(name_of(f.hint)) : Json(nullptr)},
                        {"value", has_hint ? Json(f.hint.value) : Json(nullptr)}});
  }
  root["notes"] = notes_;
  Json& camera = root["camera"] = pace_json(sights, kPaced_s, [](const Sight& s) { return s.stamp; });
  camera["edge_px"] = sights.empty() ? 0 : sights.back().edge_px;
  camera["tracks"] = sights.empty() ? 0 : sights.back().tracks;
  Json& edges = camera["edges"] = Json::array();  // seconds before the newest image, px
  for (const Sight& s : sights)
    if (s.edge_px > 0) edges.push_back({(s.stamp - sights.back().stamp).seconds(), s.edge_px});
  Json& imu = root["imu"] = pace_json(seen_.readings, kPaced_s, [](HostStamp s) { return s; });
  imu["rate_rad_s"] = newest_.angular_velocity_rad_s;
  imu["force_m_s2"] = newest_.specific_force_m_s2;
  imu["turned_rad"] = seen_.turned;
  const ImuSpectrum s = seen_.spectrum.result();
  root["spectrum"] = {{"step_hz", s.step_hz},
                      {"gyroscope", s.gyroscope},
                      {"accelerometer", s.accelerometer},
                      {"gyroscope_rms", s.gyroscope_rms},
                      {"accelerometer_rms", s.accelerometer_rms},
                      {"peak_hz", peak_hz(s.accelerometer, s.step_hz)},
                      {"gyroscope_configured", subject_.gyroscope_density},
                      {"accelerometer_configured", subject_.accelerometer_density}};
  // device names may hold any bytes
  return root.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace epiline
