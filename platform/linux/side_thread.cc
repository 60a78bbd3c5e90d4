#include "platform/linux/side_thread.h"

#include <atomic>
#include <cstdint>
#include <utility>

#include "platform/concurrency/parking.h"
#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

class KernelSideThread final : public SideThread {
 public:
  KernelSideThread(void (*work)(void*), void* context) : work_(work), context_(context) {}
  ~KernelSideThread() override {
    ends_.store(true, std::memory_order_relaxed);
    parking_.notify();
    thread_.join();
  }
  bool start(const char* name) { return thread_.start({.name = name}, run, this); }

  void wake() noexcept override {
    wakes_.fetch_add(1, std::memory_order_release);  // pairs with the acquire in run(): what is to be done is complete
    parking_.notify();
  }

 private:
  static void run(void* self) {
    auto& side = *static_cast<KernelSideThread*>(self);
    constexpr std::int64_t kLong_ns = 3'600'000'000'000;
    std::uint32_t seen = 0;
    const auto ends = [&] { return side.ends_.load(std::memory_order_relaxed); };
    const auto is_woken = [&] { return side.wakes_.load(std::memory_order_acquire) != seen; };
    while (!ends()) {
      if (!side.parking_.wait_until(monotonic_ns() + kLong_ns, [&] { return ends() || is_woken(); })) continue;
      if (!is_woken()) continue;
      seen = side.wakes_.load(std::memory_order_acquire);
      side.work_(side.context_);
    }
  }

  void (*work_)(void*);
  void* context_;
  std::atomic<std::uint32_t> wakes_{0};
  std::atomic<bool> ends_{false};
  Parking parking_;
  RealtimeThread thread_;
};

}  // namespace

std::unique_ptr<SideThread> start_side_thread(const char* name, void (*work)(void*), void* context) {
  auto thread = std::make_unique<KernelSideThread>(work, context);
  return thread->start(name) ? std::move(thread) : nullptr;
}

}  // namespace epiline
