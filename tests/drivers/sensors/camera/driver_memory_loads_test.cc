// How often the memory of a camera's driver is read. Where it is not cached, a load costs about 150 ns, whether of a
// byte or of eight: so the loads are counted, one processor instruction at a time.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <ucontext.h>

#include <csignal>
#include <cstdio>
#include <vector>

#include "drivers/sensors/camera/grey_copies.h"
#include "platform/time/monotonic.h"
#include "tests/drivers/fake_kernel.h"

namespace epiline {
namespace {

#if defined(__x86_64__) && !defined(EPILINE_SANITIZED)

constexpr std::size_t kBytes = 1U << 16;
constexpr greg_t kTrapFlag = 0x100;
void* watched = nullptr;
std::size_t loads = 0;

/// Lets the one instruction that reads go on.
void on_load(int, siginfo_t* info, void* context) {
  const auto* const at = static_cast<const char*>(info->si_addr);
  const auto* const begin = static_cast<const char*>(watched);
  if (at < begin || at >= begin + kBytes) std::abort();
  ++loads;
  mprotect(watched, kBytes, PROT_READ | PROT_WRITE);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] |= kTrapFlag;
}
void after_load(int, siginfo_t*, void* context) {
  mprotect(watched, kBytes, PROT_NONE);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] &= ~kTrapFlag;
}

/// Counts loads from `watched` while it lives.
class Watch {
 public:
  Watch() {
    install(SIGSEGV, on_load, segv_);
    install(SIGTRAP, after_load, trap_);
    loads = 0;
    mprotect(watched, kBytes, PROT_NONE);
  }
  ~Watch() {
    mprotect(watched, kBytes, PROT_READ | PROT_WRITE);
    sigaction(SIGSEGV, &segv_, nullptr);
    sigaction(SIGTRAP, &trap_, nullptr);
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

 private:
  static void install(int signal, void (*handler)(int, siginfo_t*, void*), struct sigaction& before) {
    struct sigaction action {};
    action.sa_sigaction = handler;
    action.sa_flags = SA_SIGINFO;
    sigaction(signal, &action, &before);
  }
  struct sigaction segv_ {
  }, trap_{};
};

DeviceFormat format_of(PixelFormat kind, int width, int height) {
  DeviceFormat format;
  format.format = kind;
  format.width = width;
  format.height = height;
  format.stride = static_cast<int>(row_bytes(kind, width));
  return format;
}

double milliseconds_for(const GreyCopies& copies, const DeviceFormat& format) {
  std::vector<std::uint8_t> from(static_cast<std::size_t>(format.stride * format.height), 0x5a);
  std::vector<std::uint8_t> to(static_cast<std::size_t>(format.grey_width() * format.grey_height()));
  std::int64_t best_ns = INT64_MAX;
  for (int i = 0; i < 5; ++i) {
    const std::int64_t begin_ns = monotonic_ns();
    copies.copy(format, {from.data(), from.size(), -1}, from.size(), to.data(), format.grey_width());
    best_ns = std::min(best_ns, monotonic_ns() - begin_ns);
  }
  return 1e-6 * static_cast<double>(best_ns);
}

TEST(DriverMemory, IsReadInWordsWhateverTheFormat) {
  watched = mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(watched, MAP_FAILED);
  test::FakeKernel kernel;
  for (int kind = 0; kind < static_cast<int>(PixelFormat::kMjpeg); ++kind) {
    const DeviceFormat format = format_of(static_cast<PixelFormat>(kind), 640, 8);
    GreyCopies copies(kernel);
    copies.set_format(format);
    std::vector<std::uint8_t> to(static_cast<std::size_t>(format.grey_width() * format.grey_height()));
    const DriverMemory memory{static_cast<std::uint8_t*>(watched), kBytes, -1};
    {
      const Watch watch;
      copies.copy(format, memory, kBytes, to.data(), format.grey_width());
    }
    const std::size_t row = row_bytes(format.format, format.width), rows = static_cast<std::size_t>(format.height);
    EXPECT_GT(loads, 0U) << to_string(format.format);
    EXPECT_LE(loads, rows * (row / 8 + 1)) << to_string(format.format);
    const DeviceFormat large = format_of(format.format, 1456, 1088);
    copies.set_format(large);
    std::printf("%-5s %.2f loads for 8 bytes, %.2f ms for 1456x1088\n", to_string(format.format),
                8.0 * static_cast<double>(loads) / static_cast<double>(rows * row), milliseconds_for(copies, large));
  }
  // what a conversion that reads the driver's memory itself would cost
  const DeviceFormat packed = format_of(*pixel_format_named("pRAA"), 640, 8);
  std::vector<std::uint8_t> to(std::size_t{320} * 4);
  {
    const Watch watch;
    to_grey(packed.format, static_cast<std::uint8_t*>(watched), packed.stride, 640, 8, to.data(), 320);
  }
  EXPECT_GE(loads, 640U * 8);
  munmap(watched, kBytes);
}

#endif

}  // namespace
}  // namespace epiline
