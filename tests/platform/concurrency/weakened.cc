// Negative control of the thread tests: the same traffic through rings and boxes with one memory order taken away.
// Under the thread sanitizer each must be reported as a data race; if one is not, the thread tests prove nothing.
#include <cstdio>
#include <cstring>

#include "tests/platform/concurrency/stress.h"

namespace {

using namespace epiline;
using stress::Numbered;

struct NoPublish : SoundOrders {
  static constexpr std::memory_order kPublish = std::memory_order_relaxed;
};
struct NoObserve : SoundOrders {
  static constexpr std::memory_order kObserve = std::memory_order_relaxed;
};
struct NoRelease : SoundOrders {
  static constexpr std::memory_order kRelease = std::memory_order_relaxed;
};
struct NoReclaim : SoundOrders {
  static constexpr std::memory_order kReclaim = std::memory_order_relaxed;
};
struct OnlyAcquire : SoundOrders {
  static constexpr std::memory_order kSwap = std::memory_order_acquire;
};
struct OnlyRelease : SoundOrders {
  static constexpr std::memory_order kSwap = std::memory_order_release;
};

constexpr std::uint64_t kCount = 2000;

template <class Orders>
void ring() {
  SpscRing<Numbered, 4, Orders> weakened;
  stress::through_ring(weakened, kCount);
}

template <class Orders>
void box() {
  LatestValue<Numbered, Orders> weakened;
  stress::through_box(weakened, kCount);
}

// Without the orders of the ring only the notification would order the payload, and it does when the reader has slept;
// a busy reader finds the race.
template <class RingOrders, class LoanOrders>
void slots() {
  NewestRing<4, RingOrders> ring;
  stress::Lender<8, LoanOrders> lender(8);
  stress::SlotTraffic(ring, lender, kCount).run();
}

}  // namespace

int main(int argc, char** argv) {
  const struct {
    const char* name;
    void (*run)();
  } cases[] = {
      {"ring.publish", ring<NoPublish>},
      {"ring.observe", ring<NoObserve>},
      {"ring.release", ring<NoRelease>},
      {"ring.reclaim", ring<NoReclaim>},
      {"ring.sound", ring<SoundOrders>},
      {"box.acquire", box<OnlyAcquire>},
      {"box.release", box<OnlyRelease>},
      {"box.sound", box<SoundOrders>},
      {"slots.publish", slots<NoPublish, SoundOrders>},
      {"slots.observe", slots<NoObserve, SoundOrders>},
      {"slots.give_back_acquire", slots<SoundOrders, OnlyAcquire>},
      {"slots.give_back_release", slots<SoundOrders, OnlyRelease>},
      {"slots.sound", slots<SoundOrders, SoundOrders>},
  };
  for (const auto& c : cases) {
    if (argc == 2 && std::strcmp(argv[1], c.name) == 0) {
      c.run();
      std::printf("%s: done\n", c.name);
      return 0;
    }
  }
  return 2;
}
