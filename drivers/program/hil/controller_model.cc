#include "drivers/program/hil/controller_model.h"

#include <fmt/format.h>

#include <algorithm>

#include "platform/time/clock_state.h"

namespace epiline::hil {

namespace {
constexpr Span kHeartbeatEvery = Span::from_milliseconds(1000), kHeartbeatLost = Span::from_milliseconds(2500);
constexpr double kHeartbeatLeast_hz = 0.8, kHeartbeatMost_hz = 1.25;
constexpr Span kLatencyPx4 = Span::from_milliseconds(200), kLatencyArdupilot = Span::from_milliseconds(250);
constexpr Span kClockDoubt = Span::from_milliseconds(10);  // what an exchange of 10 ms leaves open
constexpr int kExchangesToJudge = 10;                      // before, the clocks are not known
constexpr int kFailuresMost = 5;
constexpr Span kTextWindow = Span::from_milliseconds(10'000);
constexpr std::uint64_t kTextsMost = 10;
constexpr std::uint8_t kAutopilotComponent = 1;
constexpr std::uint8_t kOnboardController = 18, kNoAutopilot = 8, kQuadrotor = 2, kStandby = 3;

double milliseconds(std::int64_t ns) { return 1e-6 * static_cast<double>(ns); }

/// What is wrong with a text; empty: nothing.
std::string text_fault(const mavlink::StatusText& m) {
  const auto* const end = std::find(m.text.begin(), m.text.end(), '\0');
  if (end == m.text.begin()) return "an empty text";
  const bool printable = std::all_of(m.text.begin(), end, [](char c) { return c >= ' ' && c <= '~'; });
  if (!printable) return "characters that cannot be printed";
  return m.severity <= 7 ? "" : fmt::format("severity {}", m.severity);
}

}  // namespace

ControllerModel::ControllerModel(const ControllerSettings& settings, Truth truth)
    : settings_(settings), truth_(std::move(truth)), can_(settings.can_base_id), fusion_(settings.R_VB) {}

std::int64_t ControllerModel::to_controller_ns(HostStamp host) const {
  return host.ns - settings_.boot.ns +
         static_cast<std::int64_t>(1e-6 * settings_.skew_ppm * static_cast<double>(host.ns));
}

template <class Message>
void ControllerModel::send(const Message& message) {
  if (waiting_.size() < kMostWaiting)
    waiting_.push_back(mavlink::pack(message, {settings_.system, kAutopilotComponent}, 0));
}

const mavlink::Packet* ControllerModel::next(HostStamp now) {
  if (settings_.on_can) return nullptr;
  if (!next_question_) next_heartbeat_ = next_question_ = now;
  if (now >= *next_heartbeat_) {
    next_heartbeat_ = now + kHeartbeatEvery;
    send(mavlink::Heartbeat{0, kQuadrotor, settings_.is_ardupilot ? mavlink::kArduPilot : mavlink::kPx4, 0, kStandby,
                            3});
  }
  if (now >= *next_question_) ask(now);
  for (ImuSample reading; waiting_.empty() && readings_.pop(reading);) send_reading(reading);
  if (waiting_.empty()) return nullptr;
  sending_ = waiting_.front();
  waiting_.pop_front();
  sending_.sequence = sequence_++;
  return &sending_;
}

void ControllerModel::receive(const mavlink::Packet& packet, HostStamp arrival) {
  judge_sender(packet, arrival);
  if (!first_packet_) first_packet_ = arrival;
  const auto take = [&]<class Message>(Message message) {
    if (!mavlink::unpack(packet, message)) return;
    if constexpr (requires { judge_message(message, arrival, book_); }) {
      take_estimate(judge_message(message, arrival, book_), arrival);
    } else {
      receive(message, arrival);
    }
  };
  take(mavlink::Odometry{});
  take(mavlink::VisionPositionEstimate{});
  take(mavlink::Heartbeat{});
  take(mavlink::Timesync{});
  take(mavlink::StatusText{});
  take(mavlink::CommandLong{});
  take(mavlink::SetGpsGlobalOrigin{});
}

void ControllerModel::receive(const can::Frame& frame, HostStamp arrival) {
  const auto message = can_.take(frame, arrival, book_);
  if (can_.says_silence()) stream_.take_text(arrival);
  if (message) take_estimate(judge_message(*message, arrival, book_), arrival);
}

void ControllerModel::judge_sender(const mavlink::Packet& packet, HostStamp arrival) {
  const bool ours = book_.judge(
      Rule::kAddress, packet.from.system == settings_.system && packet.from.component == settings_.companion, arrival,
      [&] { return fmt::format("message {} from {}/{}", packet.id, packet.from.system, packet.from.component); });
  if (!ours) return;
  if (newest_sequence_) {
    const auto expected = static_cast<std::uint8_t>(*newest_sequence_ + 1);
    book_.judge(Rule::kSequence, packet.sequence == expected, arrival,
                [&] { return fmt::format("number {} after {}", packet.sequence, *newest_sequence_); });
  }
  newest_sequence_ = packet.sequence;
}

void ControllerModel::take_estimate(const std::optional<VisionSample>& sample, HostStamp arrival) {
  ++estimates_;
  if (!sample || !stream_.take(arrival, sample->stamp, book_)) return;
  if (!newest_counter_ || *newest_counter_ != sample->reset_counter) received_.emplace_back();
  newest_counter_ = sample->reset_counter;
  add_pose(pose_of(*sample, settings_.R_VB), received_.back());
  judge_latency(*sample);
  book_.judge(Rule::kArming, sample->is_north, arrival, [] { return std::string("poses in a frame without a north"); });
  motion_.take(*sample, book_);
  if (truth_) fusion_.take(*sample, truth_(sample->stamp), book_);
}

void ControllerModel::judge_latency(const VisionSample& sample) {
  if (!settings_.on_can && timesync_.count() < kExchangesToJudge) return;
  const Span latency = settings_.on_can
                           ? sample.arrival - sample.stamp
                           : Span{to_controller_ns(sample.arrival) - (sample.stamp.ns + timesync_.offset_ns())};
  latency_.add(latency.ns);
  const auto judge = [&](Rule rule, Span most) {
    book_.judge(rule, latency >= -kClockDoubt && latency <= most, sample.arrival,
                [&] { return fmt::format("{:.1f} ms", milliseconds(latency.ns)); });
  };
  judge(Rule::kLatencyPx4, kLatencyPx4);
  judge(Rule::kLatencyArdupilot, kLatencyArdupilot);
}

void ControllerModel::receive(const mavlink::Heartbeat& m, HostStamp arrival) {
  book_.judge(Rule::kHeartbeat, m.type == kOnboardController && m.autopilot == kNoAutopilot, arrival,
              [&] { return fmt::format("type {}, autopilot {}", m.type, m.autopilot); });
  judge_heartbeats(arrival);
  if (!first_heartbeat_) first_heartbeat_ = arrival;
  newest_heartbeat_ = arrival;
  ++heartbeats_;
}

void ControllerModel::judge_heartbeats(HostStamp until) {
  const HostStamp since = newest_heartbeat_.value_or(first_packet_.value_or(until));
  book_.judge(Rule::kHeartbeat, until - since <= kHeartbeatLost, until,
              [&] { return fmt::format("{:.1f} s without a heartbeat", (until - since).seconds()); });
}

void ControllerModel::receive(const mavlink::StatusText& m, HostStamp arrival) {
  stream_.take_text(arrival);
  const std::string fault = text_fault(m);
  book_.judge(Rule::kStatusText, fault.empty(), arrival, [&] { return fault; });
  if (!text_window_ || arrival - *text_window_ > kTextWindow) {
    text_window_ = arrival;
    texts_in_window_ = 0;
  }
  ++texts_in_window_;
  book_.judge(Rule::kStatusText, texts_in_window_ <= kTextsMost, arrival,
              [&] { return fmt::format("{} texts within 10 s", texts_in_window_); });
}

void ControllerModel::receive(const mavlink::Timesync& m, HostStamp arrival) {
  if (m.tc1 == 0) {
    send(mavlink::Timesync{to_controller_ns(arrival), m.ts1, 0, 0});
  } else {
    take_answer(m, arrival);
  }
}

/// SET_MESSAGE_INTERVAL is all it understands.
void ControllerModel::receive(const mavlink::CommandLong& m, HostStamp /*arrival*/) {
  constexpr std::uint16_t kSetMessageInterval = 511;
  constexpr float kMost_us = 1e7F;
  constexpr std::uint8_t kAccepted = 0, kDenied = 2, kUnknown = 3;
  const bool known = m.command == kSetMessageInterval && m.param1 == static_cast<float>(mavlink::HighresImu::kId);
  const bool sensible = m.param2 > 0 && m.param2 < kMost_us;  // false for what is no number
  if (known && sensible) {
    reading_every_ = Span{static_cast<std::int64_t>(m.param2) * 1000};
    readings_wanted_();
  }
  mavlink::CommandAck answer;
  answer.command = m.command;
  answer.result = !known ? kUnknown : sensible ? kAccepted : kDenied;
  send(answer);
}

void ControllerModel::receive(const mavlink::SetGpsGlobalOrigin& m, HostStamp arrival) {
  constexpr std::int32_t kLatitudeMost = 900'000'000, kLongitudeMost = 1'800'000'000;
  if (!origin_) origin_ = m;
  const bool on_earth = m.latitude >= -kLatitudeMost && m.latitude <= kLatitudeMost && m.longitude >= -kLongitudeMost &&
                        m.longitude <= kLongitudeMost;
  const bool same = m.latitude == origin_->latitude && m.longitude == origin_->longitude &&
                    m.altitude == origin_->altitude && m.target_system == settings_.system;
  book_.judge(Rule::kOrigin, on_earth && same, arrival, [&] {
    return fmt::format("{}, {} (1e-7 degrees), {} mm, for system {}", m.latitude, m.longitude, m.altitude,
                       m.target_system);
  });
}

/// In the vehicle's axes: forward, right, down.
void ControllerModel::send_reading(const ImuSample& reading) {
  if (next_reading_ && reading.stamp < *next_reading_) return;
  // Send on a grid that restarts after a gap. A sample may be a fifth early, because timestamps jitter about the grid.
  const Span early{reading_every_.ns / 5};
  const bool steady = next_reading_ && reading.stamp - *next_reading_ < reading_every_;
  next_reading_ = (steady ? *next_reading_ + early : reading.stamp) + reading_every_ - early;
  const Mat3 R_FB = Vec3(1, -1, -1).asDiagonal() * settings_.R_VB;
  const Vec3 force = R_FB * Vec3(reading.specific_force_m_s2.data());
  const Vec3 rates = R_FB * Vec3(reading.angular_velocity_rad_s.data());
  mavlink::HighresImu m;
  m.time_usec = static_cast<std::uint64_t>(to_controller_ns(reading.stamp) / 1000);
  m.xacc = static_cast<float>(force.x());
  m.yacc = static_cast<float>(force.y());
  m.zacc = static_cast<float>(force.z());
  m.xgyro = static_cast<float>(rates.x());
  m.ygyro = static_cast<float>(rates.y());
  m.zgyro = static_cast<float>(rates.z());
  m.fields_updated = 0x3f;
  send(m);
}

void ControllerModel::ask(HostStamp now) {
  // a missing answer counts only after the companion has sent its first packet
  if (question_ns_ && first_packet_) judge_answer(false, now, "no answer before the next question");
  next_question_ = now + Span::from_seconds(1 / settings_.timesync_hz);
  question_ns_ = to_controller_ns(now);
  send(mavlink::Timesync{0, *question_ns_, 0, 0});
}

void ControllerModel::take_answer(const mavlink::Timesync& m, HostStamp arrival) {
  if (!question_ns_ || m.ts1 != *question_ns_) {
    judge_answer(false, arrival, "an answer to no question");
    return;
  }
  const std::int64_t now_ns = to_controller_ns(arrival), asked_ns = *question_ns_;
  question_ns_.reset();
  ++exchanges_;
  round_trip_.add(now_ns - asked_ns);
  if (m.tc1 < 0 || !is_clock_time(HostStamp{m.tc1})) {
    judge_answer(false, arrival, "an answer that is no time");
    return;
  }
  const bool was_converged = timesync_.converged();
  const TimesyncFilter::Outcome outcome = timesync_.update(asked_ns, m.tc1, now_ns);
  judge_answer(outcome != TimesyncFilter::Outcome::kSlow, arrival, "an answer after more than 10 ms");
  if (was_converged || timesync_.converged())
    book_.judge(Rule::kTimesyncConvergence, outcome != TimesyncFilter::Outcome::kReset, arrival,
                [] { return std::string("the companion's clock jumped by more than 100 ms"); });
}

/// PX4 lives with single failures: a rule is broken by the sixth in a row.
void ControllerModel::judge_answer(bool good, HostStamp at, const char* what) {
  failed_in_a_row_ = good ? 0 : failed_in_a_row_ + 1;
  book_.judge(Rule::kTimesyncAnswers, failed_in_a_row_ <= kFailuresMost, at,
              [&] { return fmt::format("{}, {} times in a row", what, failed_in_a_row_); });
}

Verdict ControllerModel::finish(HostStamp end) {
  stream_.finish(end, book_);
  if (settings_.on_can) can_.finish(end, book_);
  if (first_packet_) judge_heartbeats(end);
  if (heartbeats_ >= 5) {
    const double rate_hz = static_cast<double>(heartbeats_ - 1) / (*newest_heartbeat_ - *first_heartbeat_).seconds();
    const auto text = [&] { return fmt::format("{:.2f} Hz", rate_hz); };
    book_.judge(Rule::kHeartbeat, rate_hz >= kHeartbeatLeast_hz && rate_hz <= kHeartbeatMost_hz, end, text);
    book_.figure(Rule::kHeartbeat, text());
  } else if (first_packet_) {
    book_.judge(Rule::kHeartbeat, heartbeats_ > 0, end, [] { return std::string("no heartbeat at all"); });
  }
  if (settings_.wants_origin && !origin_)
    book_.judge(Rule::kOrigin, false, end, [] { return std::string("none came"); });
  const auto quantiles = [](const LatencyBins& bins) {
    return fmt::format("{:.2f} ms median, {:.2f} ms 99 %, {:.2f} ms at most", milliseconds(bins.quantile_ns(0.5)),
                       milliseconds(bins.quantile_ns(0.99)), milliseconds(bins.most_ns()));
  };
  if (latency_.count() > 0) {
    book_.figure(Rule::kLatencyPx4, quantiles(latency_));
    book_.figure(Rule::kLatencyArdupilot, quantiles(latency_));
  }
  if (exchanges_ > 0) book_.figure(Rule::kTimesyncAnswers, "round trip " + quantiles(round_trip_));
  book_.figure(Rule::kTimesyncConvergence, fmt::format("{} exchanges", timesync_.count()));
  return book_.verdict();
}

}  // namespace epiline::hil
