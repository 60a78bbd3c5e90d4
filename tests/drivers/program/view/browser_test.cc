// The page in a browser, looked at as a picture: headless Chromium, where it is installed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "drivers/program/view/live_view.h"
#include "tests/drivers/program/view/browser.h"
#include "tests/drivers/program/view/client.h"
#include "tests/drivers/program/view/flight_of_view.h"

namespace epiline {
namespace {

class Browser : public BrowserTest {
 protected:
  void SetUp() override {
    BrowserTest::SetUp();
    if (IsSkipped()) return;
    if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
    auto view = LiveView::open({"127.0.0.1", 0});
    ASSERT_TRUE(view) << view.error().text();
    view_ = std::move(*view);
  }
  void TearDown() override {
    view_.reset();
    BrowserTest::TearDown();
  }

  static int count(const cv::Mat& picture, const cv::Vec3b& bgr, int tolerance) {
    int n = 0;
    for (const cv::Vec3b& p : cv::Mat_<cv::Vec3b>(picture)) {
      n += std::abs(p[0] - bgr[0]) <= tolerance && std::abs(p[1] - bgr[1]) <= tolerance &&
           std::abs(p[2] - bgr[2]) <= tolerance;
    }
    return n;
  }

  Look look(const std::string& option) const { return BrowserTest::look(url_of(view_->address()), option); }

  std::unique_ptr<LiveView> view_;
};

TEST_F(Browser, ShowsStateAndImageAndComplainsOfNothing) {
  ASSERT_TRUE(view_->start({"a <b>made up</b> flight", "epiline test", Mat3::Identity(), true}));
  // the flight stands while it is looked at: on a busy computer a browser may never be done with one that goes on
  ViewedFlight flight(view_->observer());
  for (int i = 0; i < 100; ++i) flight.fly();
  const Look page = look("--dump-dom");
  const Look picture = look("--screenshot='" + (folder_ / "page.png").string() + "'");
  EXPECT_EQ(page.complaints + picture.complaints, "");
  EXPECT_NE(page.out.find(">Tracking<"), std::string::npos);
  EXPECT_NE(page.out.find(">live<"), std::string::npos);
  EXPECT_NE(page.out.find("88 %"), std::string::npos);
  EXPECT_NE(page.out.find("20.0 Hz"), std::string::npos);
  EXPECT_NE(page.out.find("200 Hz"), std::string::npos);
  EXPECT_NE(page.out.find("a &lt;b&gt;made up&lt;/b&gt; flight"), std::string::npos);
  const cv::Mat shot = cv::imread((folder_ / "page.png").string());
  ASSERT_FALSE(shot.empty());
  const int grey = ViewedFlight::kGrey;
  EXPECT_GT(count(shot, cv::Vec3b(grey, grey, grey), 1), 50'000);  // the image ...
  EXPECT_GT(count(shot, cv::Vec3b(54, 90, 255), 12), 300);         // ... with its new tracks
  EXPECT_GT(count(shot, cv::Vec3b(0xb7, 0x67, 0x16), 12), 500);    // the path
  EXPECT_GT(count(shot, cv::Vec3b(0x5a, 0x91, 0x23), 6), 3'000);   // the badge, green
}

TEST_F(Browser, SaysThatTheStateIsLostAndWhy) {
  ASSERT_TRUE(view_->start({"trouble", "epiline test", {}, true}));
  ViewedFlight flight(view_->observer());
  flight.next_outcome().odometry.health = {HealthState::kLost, 512 | 32, -1};
  for (int i = 0; i < 3; ++i) flight.fly();
  const Look page = look("--dump-dom");
  EXPECT_EQ(page.complaints, "");
  EXPECT_NE(page.out.find(">Lost<"), std::string::npos);
  EXPECT_NE(page.out.find("A value of the state is not finite."), std::string::npos);
  EXPECT_NE(page.out.find("A bias is larger than that of any working sensor."), std::string::npos);
}

TEST_F(Browser, IsWholeBeforeTheFirstImageAndAfterTheLast) {
  ASSERT_TRUE(view_->start({"nothing yet", "epiline test", {}, true}));
  const Look before = look("--dump-dom");
  EXPECT_EQ(before.complaints, "");
  EXPECT_NE(before.out.find("No image yet."), std::string::npos);
  view_->finish();
  const Look after = look("--dump-dom");
  EXPECT_EQ(after.complaints, "");
  EXPECT_NE(after.out.find(">finished<"), std::string::npos);
}

}  // namespace
}  // namespace epiline
