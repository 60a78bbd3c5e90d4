// The page in a browser, looked at as a picture: headless Chromium, where it is installed.
#include <gtest/gtest.h>

#include <array>
#include <opencv2/core.hpp>

#include "drivers/program/view/live_view.h"
#include "tests/drivers/program/must.h"
#include "tests/drivers/program/view/browser.h"
#include "tests/drivers/program/view/client.h"
#include "tests/drivers/program/view/flight_of_view.h"

namespace epiline {
namespace {

using test::must;

class LivePage : public BrowserTest {
 protected:
  void SetUp() override {
    BrowserTest::SetUp();
    if (IsSkipped()) return;
    if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
    view_ = must(LiveView::open({"127.0.0.1", 0}));
  }
  void TearDown() override {
    view_.reset();
    BrowserTest::TearDown();
  }

  std::string url() const { return url_of(view_->address()); }

  std::unique_ptr<LiveView> view_;
};

TEST_F(LivePage, ShowsStateAndImageAndComplainsOfNothing) {
  ASSERT_TRUE(view_->start({"a <b>made up</b> flight", "epiline test", Mat3::Identity(), true}));
  ViewedFlight flight(view_->observer());
  flight.fly(100);
  Browser browser(url(), folder_);
  browser.expect_texts({">Tracking<", ">live<", "88 %", "20.0 Hz", "200 Hz", "a &lt;b&gt;made up&lt;/b&gt; flight"});
  const auto pixels = [](const cv::Mat& picture) {
    const int grey = ViewedFlight::kGrey;
    return std::array{count(picture, cv::Vec3b(grey, grey, grey), 1), count(picture, cv::Vec3b(54, 90, 255), 12),
                      count(picture, cv::Vec3b(0xb7, 0x67, 0x16), 12), count(picture, cv::Vec3b(0x5a, 0x91, 0x23), 6)};
  };
  const auto is_whole = [&](const cv::Mat& picture) {
    const auto [image, new_tracks, path, green_badge] = pixels(picture);
    return image > 50'000 && new_tracks > 300 && path > 500 && green_badge > 3'000;
  };
  const cv::Mat picture = browser.photograph_when(is_whole);
  EXPECT_TRUE(is_whole(picture)) << testing::PrintToString(pixels(picture));
  EXPECT_EQ(browser.complaints(), "");
}

TEST_F(LivePage, SaysThatTheStateIsLostAndWhy) {
  ASSERT_TRUE(view_->start({"trouble", "epiline test", {}, true}));
  ViewedFlight flight(view_->observer());
  flight.next_outcome().odometry.health = {HealthState::kLost, 512 | 32, -1};
  flight.fly(3);
  Browser browser(url(), folder_);
  browser.expect_texts(
      {">Lost<", "A value of the state is not finite.", "A bias is larger than that of any working sensor."});
  EXPECT_EQ(browser.complaints(), "");
}

TEST_F(LivePage, IsWholeBeforeTheFirstImageAndAfterTheLast) {
  ASSERT_TRUE(view_->start({"nothing yet", "epiline test", {}, true}));
  Browser browser(url(), folder_);
  browser.expect_texts({"No image yet."});
  view_->finish();
  browser.expect_texts({">finished<"});
  EXPECT_EQ(browser.complaints(), "");
}

}  // namespace
}  // namespace epiline
