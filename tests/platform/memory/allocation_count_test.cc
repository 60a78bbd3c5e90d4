#include "platform/memory/allocation_count.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <cstdlib>
#include <new>
#include <thread>
#include <vector>

namespace epiline {
namespace {

// Keeps the compiler from removing an allocation that nobody uses.
template <class T>
T* used(T* p) {
  T* volatile kept = p;
  return kept;
}

class AllocationCount : public ::testing::Test {
 protected:
  void SetUp() override {
#ifdef EPILINE_SANITIZED
    ASSERT_FALSE(allocation_counting_available());
    GTEST_SKIP() << "a sanitizer owns malloc: heap calls are not counted";
#else
    ASSERT_TRUE(allocation_counting_available());
#endif
  }
};

TEST_F(AllocationCount, EachKindOfCallCountsOnce) {
  const HeapCallScope scope;
  void* p = used(std::malloc(10));
  ASSERT_EQ(scope.calls(), 1);
  p = used(std::realloc(p, 100000));
  EXPECT_EQ(scope.calls(), 2);
  p = used(::reallocarray(p, 10, 20));
  EXPECT_EQ(scope.calls(), 3);
  std::free(p);
  std::free(used(std::calloc(3, 5)));
  EXPECT_EQ(scope.calls(), 4);
  std::free(used(std::aligned_alloc(64, 128)));
  EXPECT_EQ(scope.calls(), 5);
  std::free(used(::memalign(64, 128)));
  EXPECT_EQ(scope.calls(), 6);
  void* q = nullptr;
  ASSERT_EQ(::posix_memalign(&q, 256, 1000), 0);
  EXPECT_EQ(scope.calls(), 7);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(q) % 256, 0);
  std::free(q);
  EXPECT_EQ(scope.calls(), 7) << "free does not count";
}

TEST_F(AllocationCount, SeesNewInItsForms) {
  struct alignas(128) Wide {
    char bytes[128];
  };
  const HeapCallScope scope;
  delete used(new int(3));
  EXPECT_EQ(scope.calls(), 1);
  delete used(new Wide);
  EXPECT_EQ(scope.calls(), 2);
  delete used(new (std::nothrow) int(3));
  EXPECT_EQ(scope.calls(), 3);
  const std::vector<int> v(100);
  EXPECT_NE(used(v.data()), nullptr);
  EXPECT_EQ(scope.calls(), 4);
}

TEST_F(AllocationCount, ThreadsCountForThemselves) {
  std::uint64_t of_other = 0;
  std::thread other([&] {
    const HeapCallScope scope;
    for (int i = 0; i < 50; ++i) delete used(new int(i));
    of_other = scope.calls();
  });
  const HeapCallScope scope;
  other.join();
  EXPECT_EQ(scope.calls(), 0);
  EXPECT_EQ(of_other, 50);
}

TEST_F(AllocationCount, BadRequestsFailAsTheStandardSays) {
  void* q = nullptr;
  EXPECT_EQ(::posix_memalign(&q, 3, 8), EINVAL);
  EXPECT_EQ(::posix_memalign(&q, 0, 8), EINVAL);
  EXPECT_EQ(q, nullptr);
  const volatile std::size_t huge = SIZE_MAX / 2;
  EXPECT_EQ(::reallocarray(nullptr, huge, 3), nullptr);
}

}  // namespace
}  // namespace epiline
