#include "drivers/program/dds/dds_output.h"

#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "drivers/sensors/wheel/arrival_clock.h"
#include "drivers/study/report/ros_messages.h"
#include "pipeline/text/table.h"
#include "platform/linux/signals.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

// ROS 2 puts `rt` before a topic's name, and `dds_` and an underscore into a type's.
constexpr DdsTopic kTopics[] = {
    {"rt/odometry", "nav_msgs::msg::dds_::Odometry_",
     "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
    {"rt/tf", "tf2_msgs::msg::dds_::TFMessage_",
     "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"},
    {"rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_",
     "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
};
enum TopicNumber : std::size_t { kOdometry, kTransform, kDiagnostics };

constexpr ThreadSettings kThread = {.name = "dds", .stack_bytes = 512 * 1024};
constexpr Span kBetweenDiagnostics = Span::from_seconds(1);  // of a health that stays

/// Where the flight has no priority, it still goes before its readers.
void give_way() {
  constexpr int kNiceness = 10;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
}

/// As for ROS 2's nodes: that of the environment, else 0.
Result<int> domain_of_environment() {
  const char* const text = std::getenv("ROS_DOMAIN_ID");
  if (text == nullptr || *text == 0) return 0;
  std::int64_t domain = -1;
  if (parse_number(text, domain) && domain >= 0 && domain <= DdsParticipant::kMostDomain)
    return static_cast<int>(domain);
  return Error{ErrorKind::kUsage, "", 0, std::string("ROS_DOMAIN_ID=") + text,
               "0 to " + std::to_string(DdsParticipant::kMostDomain)};
}

}  // namespace

HostStamp on_system_clock(HostStamp stamp) noexcept {
  const ClockPair now = ClockPair::now();
  return stamp + Span{now.of_day_ns - now.steady_ns};
}

Status DdsOutput::open() {
  const auto domain = domain_of_environment();
  if (!domain) return domain.error();
  domain_ = *domain;
  const SignalWait blocked({SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGPIPE});  // in the threads that begin here
  const Error no_thread{ErrorKind::kRun, "", 0, "cannot start a thread", "a free thread (ulimit -u)"};
  RealtimeThread joining;  // what Cyclone DDS starts gets its niceness
  if (!joining.start(kThread, join_domain, this)) return no_thread;
  joining.join();
  if (!joined_) return joined_;
  stops_.store(false, std::memory_order_release);
  if (!thread_.start(kThread, run, this)) return no_thread;
  is_open_.store(true, std::memory_order_release);
  return Done{};
}

void DdsOutput::join_domain(void* self) {
  auto& output = *static_cast<DdsOutput*>(self);
  give_way();
  output.joined_ = output.participant_.open(output.domain_, kTopics);
}

void DdsOutput::close() noexcept {
  is_open_.store(false, std::memory_order_release);
  stops_.store(true, std::memory_order_release);
  parking_.notify();
  thread_.join();
  participant_.close();
}

void DdsOutput::take(const FrameOutcome& outcome) noexcept {
  if (!is_open_.load(std::memory_order_acquire)) return;
  ring_.push(outcome);
  parking_.notify();
}

void DdsOutput::run(void* self) {
  auto& output = *static_cast<DdsOutput*>(self);
  give_way();
  for (bool last = false; !last;) {
    const auto has_work = [&] {
      last = output.stops_.load(std::memory_order_acquire);  // before the look: what came before is found
      return output.ring_.front() != nullptr || last;
    };
    output.parking_.wait_until(monotonic_ns() + kBetweenDiagnostics.ns, has_work);
    while (const FrameOutcome* const outcome = output.ring_.front()) {
      output.send(*outcome);
      output.ring_.pop();
    }
  }
}

void DdsOutput::send(const FrameOutcome& outcome) {
  const bool has_pose = outcome.result.has_pose, is_live = times_ == Times::kOfDay;
  const HostStamp stamp = is_live ? on_system_clock(has_pose ? outcome.odometry.stamp : outcome.stamp) : outcome.stamp;
  if (has_pose) {
    const bool sent = participant_.write(kOdometry, odometry_message(outcome, stamp).bytes()) &&
                      participant_.write(kTransform, transform_message(outcome, stamp).bytes());
    ++(sent ? sent_ : not_sent_);
    if (sent && is_live) latency_.add(monotonic_ns() - outcome.stamp.ns);
  }
  if (!diagnostics_are_due(outcome)) return;
  participant_.write(kDiagnostics, diagnostics_message(outcome, stamp).bytes());
  told_ = outcome.odometry.health;
  told_at_ = outcome.stamp;
}

bool DdsOutput::diagnostics_are_due(const FrameOutcome& outcome) const {
  const Health& now = outcome.odometry.health;
  return !told_at_ || now.state != told_.state || now.reasons != told_.reasons ||
         outcome.stamp - *told_at_ >= kBetweenDiagnostics;
}

}  // namespace epiline
