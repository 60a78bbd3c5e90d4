// The log thread, the serving thread and clients at once; for the thread sanitizer.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "drivers/program/view/live_view.h"
#include "tests/drivers/program/must.h"
#include "tests/drivers/program/view/client.h"
#include "tests/drivers/program/view/flight_of_view.h"

namespace epiline {
namespace {

using test::must;

TEST(LiveViewThreads, AFlightIsWatchedFromBeginningToEnd) {
  if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
  auto view = must(LiveView::open({"127.0.0.1", 0}));
  ASSERT_TRUE(view->start({"made up", "epiline test", {}, true}));
  const std::uint16_t port = view->address().port;
  std::atomic<int> asked{0};
  std::thread log([&] {
    ViewedFlight flight(view->observer());
    while (asked.load() < 60) {
      flight.fly();
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    view->finish();
  });
  std::vector<std::thread> clients;
  for (const char* path : {"/state", "/frame", "/image"}) {
    clients.emplace_back([&asked, port, path] {
      for (int i = 0; i < 20; ++i, ++asked) EXPECT_NE(get(port, path).status, 0);
    });
  }
  for (std::thread& client : clients) client.join();
  log.join();
  view.reset();
}

}  // namespace
}  // namespace epiline
