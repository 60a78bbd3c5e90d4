// `epiline replay --realtime --view` as a user meets it: the flight is the same whoever looks.
#include <chrono>
#include <future>

#include "drivers/program/view/http_server.h"
#include "tests/drivers/program/program.h"
#include "tests/drivers/program/view/client.h"

namespace epiline {
namespace {

class ViewCommand : public OverARenderedFlight {
 protected:
  void SetUp() override {
    if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
    OverARenderedFlight::SetUp();
  }

  /// The port that the program has printed; 0: it ended without.
  static std::uint16_t port_of(const std::future<Outcome>& program) {
    const std::string before = "http://127.0.0.1:";
    while (program.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) {
      const std::string out = read(scratch() / "stdout");
      const std::size_t at = out.find(before), end = out.find("/\n", at);
      if (at == std::string::npos || end == std::string::npos) continue;
      return static_cast<std::uint16_t>(std::stoi(out.substr(at + before.size())));
    }
    return 0;
  }
};

// Half of the clients never finish their request, the others ask for more than they ever read; one looks on properly.
TEST_F(ViewCommand, WhoeverLooksTheFlightIsTheSameByteByByteWithoutHeapLocksAndNewPages) {
  ASSERT_EQ(replay("offline", "").exit_code, 0);
  const std::string config = with_config(kPatient);
  Json last;
  // a computer that had no time for us gets other chances
  for (const char* speed : {"1", "0.5", "0.25", "0.25", "0.25"}) {
    write(scratch() / "stdout", "");
    auto program = std::async(std::launch::async, replay, "viewed",
                              std::string("--realtime --view 0 --speed ") + speed + " " + config);
    const std::uint16_t port = port_of(program);
    ASSERT_NE(port, 0);
    std::vector<std::unique_ptr<RawClient>> clients;
    std::string requests = "GET /state HTTP/1.1\r\nHost: localhost\r\n\r\n";
    for (int i = 0; i < 7; ++i) requests += requests + "GET /frame HTTP/1.1\r\nHost: localhost\r\n\r\n";
    for (int i = 0; i < 60; ++i) {
      clients.push_back(std::make_unique<RawClient>(port));
      clients.back()->send_what_fits(i % 2 == 0 ? "GET /frame HT" : requests);
    }
    last = nullptr;
    while (program.wait_for(std::chrono::milliseconds(100)) != std::future_status::ready) {
      const Answer answer = get(port, "/state");
      if (answer.status == 200) last = Json::parse(answer.body);
    }
    const Outcome r = program.get();
    ASSERT_EQ(r.exit_code, 0) << r.err;
    // The program answers for 1.5 s after the flight, in a thread of low priority. A busy computer may miss that.
    if (stats("viewed")["images"]["skipped"] == 0 && !last.is_null() && last["finished"]) break;
  }
  const Json s = stats("viewed");
  ASSERT_EQ(s["images"]["skipped"], 0);
  EXPECT_TRUE(read(scratch() / "viewed/trajectory.tum") == read(scratch() / "offline/trajectory.tum"));
  expect_quiet_threads(s);
  for (const auto& [name, ring] : s["realtime"]["rings"].items()) EXPECT_EQ(ring["dropped"], 0) << name;
  // and who looked on properly saw it to the end
  ASSERT_FALSE(last.is_null());
  EXPECT_TRUE(last["finished"]);
  EXPECT_EQ(last["counts"]["images"], s["images"]["tracked"]);
  EXPECT_GT(last["image"], 0);
  if (!s["realtime"]["memory_locked"]) GTEST_SKIP() << "memory may not be locked here: page faults were not looked at";
}

TEST_F(ViewCommand, WrongUseIsOneLine) {
  expect_one_line(replay("x", "--view 8080"), 2, {"--view", "--realtime"});
  expect_one_line(replay("x", "--realtime --view 80a"), 2, {"--view 80a", "65535"});
  expect_one_line(replay("x", "--realtime --view drone:80"), 2, {"--view drone:80"});
  auto other = HttpServer::listen({"127.0.0.1", 0}, {});
  ASSERT_TRUE(other);
  expect_one_line(replay("x", "--realtime --view " + std::to_string((*other)->address().port)), 2, {"in use"});
  EXPECT_FALSE(fs::exists(scratch() / "x"));
}

}  // namespace
}  // namespace epiline
