// What the platform's pieces cost. Figures depend on the machine: docs name it next to each.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <thread>

#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/memory/allocation_count.h"
#include "platform/samples/samples.h"

namespace epiline {
namespace {

void ring_push_pop_imu_sample(benchmark::State& state) {
  SpscRing<ImuSample, 1024> ring;
  ImuSample out;
  for (auto _ : state) {
    ring.push({});
    ring.pop(out);
    benchmark::DoNotOptimize(out);
  }
}
BENCHMARK(ring_push_pop_imu_sample);

// Two threads: the time of one sample from core to core when both sides are always busy.
void ring_between_threads(benchmark::State& state) {
  static SpscRing<ImuSample, 1024> ring;
  ImuSample sample;
  const bool producer = state.thread_index() == 0;
  for (auto _ : state) {
    while (producer ? !ring.push(sample) : !ring.pop(sample)) std::this_thread::yield();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ring_between_threads)->Threads(2)->UseRealTime();

void latest_value_write_read_odometry(benchmark::State& state) {
  LatestValue<Odometry> box;
  for (auto _ : state) {
    box.draft().reset_counter++;
    box.publish();
    benchmark::DoNotOptimize(box.read());
  }
}
BENCHMARK(latest_value_write_read_odometry);

void malloc_free_while_counting(benchmark::State& state) {
  if (!allocation_counting_available()) state.SkipWithError("heap calls are not counted in this program");
  for (auto _ : state) {
    void* volatile block = std::malloc(64);
    std::free(block);
  }
}
BENCHMARK(malloc_free_while_counting);

}  // namespace
}  // namespace epiline
