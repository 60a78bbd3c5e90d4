// The live view over real sockets.
#include "drivers/program/view/live_view.h"

#include <gtest/gtest.h>

#include <thread>

#include "tests/drivers/program/must.h"
#include "tests/drivers/program/view/client.h"
#include "tests/drivers/program/view/flight_of_view.h"

namespace epiline {
namespace {

using test::must;

class LiveViewTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
    view_ = must(LiveView::open({"127.0.0.1", 0}));
    ASSERT_TRUE(view_->start({"made up", "epiline test", Mat3::Identity(), true}));
    flight_ = std::make_unique<ViewedFlight>(view_->observer());
  }
  std::uint16_t port() const { return view_->address().port; }
  Json state(const std::string& query = "") const { return Json::parse(get(port(), "/state" + query).body); }
  /// Still served?
  void expect_well() const { EXPECT_EQ(get(port(), "/").status, 200); }

  std::unique_ptr<LiveView> view_;
  std::unique_ptr<ViewedFlight> flight_;
};

TEST_F(LiveViewTest, ServesThePageWithAKeyOfItsOwn) {
  const Answer page = get(port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_NE(page.head.find("Content-Type: text/html"), std::string::npos);
  EXPECT_EQ(page.head.find("Access-Control"), std::string::npos);
  EXPECT_EQ(page.body.find("@NONCE@"), std::string::npos);
  const std::size_t at = page.head.find("script-src 'nonce-") + 18;
  const std::string key = page.head.substr(at, 32);
  EXPECT_NE(page.body.find("<script nonce=\"" + key + "\">"), std::string::npos);
  EXPECT_NE(page.head.find("default-src 'none'"), std::string::npos);
  EXPECT_EQ(get(port(), "/").head.find(key), std::string::npos);  // another each time
  // nothing from elsewhere: the only address in it names the language of the icon
  std::string rest = page.body;
  const std::string svg = "http://www.w3.org/2000/svg";
  for (std::size_t i = 0; (i = rest.find(svg)) != std::string::npos;) rest.erase(i, svg.size());
  EXPECT_EQ(rest.find("://"), std::string::npos);
}

TEST_F(LiveViewTest, HasPlainWordsForEveryStateAndReason) {
  const std::string page = get(port(), "/").body;
  for (const char* state : kHealthStateNames)
    EXPECT_NE(page.find(std::string(state) + ": \""), std::string::npos) << state;
  for (const char* reason : kHealthReasonNames) {
    const std::size_t at = page.find(std::string(reason) + ": [\"");
    EXPECT_LT(page.find("\", \"", at), page.find('\n', at)) << reason;  // in full, and short for the events
  }
}

TEST_F(LiveViewTest, TellsTheStateAndTheImage) {
  EXPECT_EQ(get(port(), "/image").status, 404);
  EXPECT_TRUE(state()["pose"].is_null());
  flight_->fly(30);
  const Json s = state();
  EXPECT_EQ(s["title"], "made up");
  EXPECT_EQ(s["counts"]["images"], 30);
  EXPECT_NEAR(s["pose"]["p"][0].get<double>(), 2 * std::cos(0.05 * 29), 1e-4);
  EXPECT_NEAR(s["latency_ms"]["p50"].get<double>(), 1.5, 0.06);
  EXPECT_EQ(state("?sample=29")["samples"]["rows"].size(), 1u);
  EXPECT_EQ(state("?sample=x")["samples"]["rows"].size(), 30u);
  const Answer image = get(port(), "/image");
  EXPECT_EQ(image.status, 200);
  EXPECT_EQ(image.body.substr(0, 3), "\xff\xd8\xff");  // a JPEG
  const Answer frame = get(port(), "/frame");
  std::size_t length = 0;
  for (int i = 3; i >= 0; --i) length = length << 8 | static_cast<unsigned char>(frame.body[i]);
  const Json tracks = Json::parse(frame.body.substr(4, length));
  EXPECT_EQ(tracks["tracks"].size(), 160u);
  EXPECT_EQ(frame.body.substr(4 + length), image.body);
}

TEST_F(LiveViewTest, IsReadOnlyAndSaysSo) {
  EXPECT_EQ(get(port(), "/etc/passwd").status, 404);
  EXPECT_EQ(get(port(), "/../view.html").status, 404);
  EXPECT_EQ(ask(port(), "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\na=b").status, 405);
  const Answer refused = ask(port(), "DELETE /state HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(refused.status, 405);
  EXPECT_NE(refused.head.find("\r\nAllow: GET, HEAD\r\n"), std::string::npos) << refused.head;
  EXPECT_EQ(ask(port(), "GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900000000000\r\n\r\n").status, 413);
  EXPECT_EQ(ask(port(), "GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n").status, 413);
  const Answer head = ask(port(), "HEAD / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(head.status, 200);
  EXPECT_NE(head.head.find("Content-Length: "), std::string::npos);
  EXPECT_TRUE(head.body.empty());
  expect_well();
}

TEST_F(LiveViewTest, PagesOfOthersGetNothingByANameOfTheirs) {
  EXPECT_EQ(get(port(), "/state", "evil.example").status, 403);
  EXPECT_EQ(get(port(), "/state", "evil.example:" + std::to_string(port())).status, 403);
  EXPECT_EQ(ask(port(), "GET /state HTTP/1.0\r\n\r\n").status, 403);  // no name at all
  EXPECT_EQ(get(port(), "/state", "127.0.0.1:" + std::to_string(port())).status, 200);
  EXPECT_EQ(get(port(), "/state", "localhost:9").status, 200);  // through a tunnel from another port
}

// Beyond this computer only those see it that know the address that was printed.
TEST(LiveViewOfANetwork, AsksForItsToken) {
  const auto view = must(LiveView::open({"0.0.0.0", 0}));
  ASSERT_TRUE(view->start({"made up", "", Mat3::Identity(), true}));
  const std::uint16_t port = view->address().port;
  const std::string url = url_of(view->address()), token = url.substr(url.find("token=") + 6);
  ASSERT_EQ(token.size(), 32U) << url;
  for (const char* path : {"/", "/state", "/frame", "/image"}) {
    EXPECT_EQ(get(port, path).status, 403) << path;
    EXPECT_EQ(get(port, path + std::string("?token=") + token.substr(1)).status, 403) << path;
    EXPECT_NE(get(port, path + std::string("?token=") + token).status, 403) << path;
  }
  EXPECT_NE(get(port, "/").body.find("with its token"), std::string::npos);
}

TEST_F(LiveViewTest, GarbageDoesNoHarm) {
  const std::string cases[] = {std::string(1, '\0'),
                               "\r\n\r\n\r\n",
                               "GET\r\n\r\n",
                               "GET / HTTP/9.9\r\nHost: localhost\r\n\r\n",
                               "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
                               "GET /%00%ff%zz?sample=%%% HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
                               "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(1 << 20, 'a') + "\r\n\r\n",
                               "GET /" + std::string(1 << 20, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n",
                               std::string(1 << 16, 'x')};
  for (const std::string& bytes : cases) {
    const RawClient client(port());
    client.send_what_fits(bytes);
    expect_well();
  }
  std::string many = "GET / HTTP/1.1\r\nHost: localhost\r\n";
  for (int i = 0; i < 20'000; ++i) many.append("X").append(std::to_string(i)).append(": y\r\n");
  const Answer answer = ask(port(), many + "\r\n");
  EXPECT_TRUE(answer.status == 0 || (answer.status >= 400 && answer.status < 500)) << answer.status;
  expect_well();
}

TEST_F(LiveViewTest, SlowAndSilentClientsHoldUpNobodyAndAreDropped) {
  const RawClient silent(port()), slow(port());
  const std::string request = "GET / HTTP/1.1\r\nHost: localhost\r\n";
  for (const char c : request) {
    slow.send(std::string(1, c));
    ASSERT_EQ(get(port(), "/state").status, 200);
  }
  EXPECT_TRUE(silent.is_closed_by_server());
  EXPECT_TRUE(slow.is_closed_by_server());  // never done with its request
}

TEST_F(LiveViewTest, HundredsOfHalfOpenConnectionsLeaveRoomForAnother) {
  const RawClient viewer(port());
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 300; ++i) {
    clients.push_back(std::make_unique<RawClient>(port()));
    clients.back()->send_what_fits("GET / HT");
    if (i % 50 == 0) {
      EXPECT_EQ(get(port(), "/state").status, 200) << i;
    }
  }
  EXPECT_EQ(get(port(), "/state").status, 200);
}

TEST_F(LiveViewTest, ReadersThatNeverReadHoldUpNobody) {
  flight_->fly(5);
  std::string requests;
  for (int i = 0; i < 2000; ++i) requests += "GET /frame HTTP/1.1\r\nHost: localhost\r\n\r\n";
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 20; ++i) {
    clients.push_back(std::make_unique<RawClient>(port()));
    clients.back()->send_what_fits(requests);
  }
  for (int i = 0; i < 20; ++i) {
    flight_->fly();
    EXPECT_EQ(get(port(), "/state").status, 200);
  }
  EXPECT_EQ(state()["counts"]["images"], 25);
}

TEST_F(LiveViewTest, APortInUseIsOneLine) {
  const auto second = LiveView::open({"127.0.0.1", port()});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("in use"), std::string::npos) << second.error().text();
  EXPECT_EQ(second.error().text().find('\n'), std::string::npos);
  const auto elsewhere = LiveView::open({"192.0.2.1", 0});  // an address kept for documents
  ASSERT_FALSE(elsewhere);
}

TEST_F(LiveViewTest, WhoLooksIsToldTheEnd) {
  flight_->fly();
  const std::uint16_t to = port();  // while there is a view to ask
  EXPECT_FALSE(state()["finished"]);
  std::thread closing([&] { view_.reset(); });
  bool told = false;
  while (!told) {
    const Answer answer = get(to, "/state");
    if (answer.status != 200) break;
    told = Json::parse(answer.body)["finished"];
  }
  closing.join();
  EXPECT_TRUE(told);
}

TEST(LiveViewAlone, ClosesAtOnceIfItWasNeverStarted) {
  if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
  const auto view = must(LiveView::open({"127.0.0.1", 0}));
  const RawClient waiting(view->address().port);
  EXPECT_TRUE(waiting.connected());
}

}  // namespace
}  // namespace epiline
