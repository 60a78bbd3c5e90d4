// The page of `epiline check --view`: what it is told, what it may write, and what it looks like.
#include "drivers/program/view/check_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/drivers/program/must.h"
#include "tests/drivers/program/view/browser.h"
#include "tests/drivers/program/view/client.h"

namespace epiline {
namespace {

using test::must;

using testing::HasSubstr;

const Findings kFindings = {{Grade::kOk, "camera", "30.00 images per second", ""},
                            {Grade::kError,
                             "camera and imu",
                             "time offset +25.0 ms (configured +0.0)",
                             "set camera.time_offset_s = 0.0250",
                             {"camera", "time_offset_s", 0.025}},
                            {Grade::kWarning, "imu", "<b>noise</b>", "dampen the mount"}};

/// A camera before a wall of bright dots and an IMU that shakes at 50 Hz, as a check sees them.
void watch(CheckWitness& witness, int images) {
  std::vector<std::uint8_t> pixels(320 * 240, 77);
  for (int i = 0; i < images; ++i) {
    Frame frame;
    frame.stamp = {1'000'000'000 + std::int64_t{i} * 50'000'000};
    frame.sequence = static_cast<std::uint64_t>(i);
    frame.data = pixels.data();
    frame.width = frame.stride = 320;
    frame.height = 240;
    TrackedFrame tracked;
    for (std::uint32_t k = 0; k < 12; ++k) {
      TrackedFeature f;
      f.id = k;
      f.age = 0;
      f.pixel = {20.0F + 24 * static_cast<float>(k), 100};
      tracked.features.push_back(f);
    }
    witness.image(frame, tracked, 2.5);
    for (int k = 0; k < 10; ++k) {
      ImuSample sample;
      sample.stamp = frame.stamp + Span{k * std::int64_t{5'000'000}};
      sample.angular_velocity_rad_s = {0.5, 0, 0};
      sample.specific_force_m_s2 = {0, std::sin(2 * 3.14159265 * 50 * 0.005 * (10 * i + k)), 9.81};
      witness.reading(sample);
    }
  }
}

class CheckPage : public BrowserTest {
 protected:
  void SetUp() override {
    if (!kLiveViewBuilt) GTEST_SKIP() << kWithoutLiveView;
    const auto accept = [this](const SettingHint& hint) -> Status {
      if (refuses_) return Error{ErrorKind::kRun, "flight.toml", 0, "read-only", "a file"};
      accepted_.push_back(name_of(hint) + "=" + std::to_string(hint.value));
      return Done{};
    };
    view_ = must(CheckView::open({"127.0.0.1", 0}, {"a <i>file</i>", "epiline test", 1e-3, 1e-2, false}, accept));
  }
  void TearDown() override {
    view_.reset();
    BrowserTest::TearDown();
  }
  std::uint16_t port() const { return view_->address().port; }
  nlohmann::json state() const { return nlohmann::json::parse(get(port(), "/state").body); }
  /// As the page does, with the key that it was given.
  Answer post(const std::string& path, std::string key = "") const {
    if (key.empty()) {
      const std::string page = get(port(), "/").body, before = "const KEY = \"";
      const auto at = page.find(before) + before.size();
      key = page.substr(at, page.find('"', at) - at);
    }
    return ask(port(), "POST " + path + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nX-Epiline-Key: " + key +
                           "\r\nConnection: close\r\n\r\n");
  }

  bool refuses_ = false;
  std::vector<std::string> accepted_;
  std::unique_ptr<CheckView> view_;
};

TEST_F(CheckPage, TellsRatesSharpnessTurnsVibrationAndFindings) {
  watch(*view_, 60);
  view_->findings(3.5, kFindings);
  const auto s = state();
  EXPECT_NEAR(s["camera"]["hz"], 20, 0.1);
  EXPECT_EQ(s["camera"]["edge_px"], 2.5);
  EXPECT_EQ(s["camera"]["tracks"], 12);
  EXPECT_NEAR(s["imu"]["hz"], 200, 1);
  EXPECT_NEAR(s["imu"]["turned_rad"][0], 0.5 * 3, 0.05);
  EXPECT_EQ(s["imu"]["turned_rad"][1], 0);
  EXPECT_NEAR(s["spectrum"]["peak_hz"], 50, 1);
  EXPECT_NEAR(s["spectrum"]["accelerometer_rms"], std::sqrt(0.5), 0.02);
  EXPECT_EQ(s["findings"].size(), 3u);
  EXPECT_EQ(s["findings"][1]["setting"], "camera.time_offset_s");
  EXPECT_TRUE(s["findings"][0]["setting"].is_null());
  EXPECT_EQ(s["seconds"], 3.5);
  EXPECT_GT(get(port(), "/frame").body.size(), 500u);
}

TEST_F(CheckPage, AnAcceptedFindingIsWrittenOnceAndOnlyByThePageItself) {
  view_->findings(1, kFindings);
  EXPECT_EQ(post("/accept?setting=camera.time_offset_s", "guess").status, 403);
  EXPECT_EQ(get(port(), "/accept?setting=camera.time_offset_s").status, 404);
  EXPECT_EQ(post("/accept?setting=camera.rate_hz").status, 404) << "no finding says so";
  EXPECT_TRUE(accepted_.empty());
  EXPECT_EQ(post("/accept?setting=camera.time_offset_s").status, 200);
  EXPECT_THAT(accepted_, testing::ElementsAre("camera.time_offset_s=0.025000"));
  const auto s = state();
  EXPECT_TRUE(s["findings"][1]["setting"].is_null()) << "no second time";
  EXPECT_THAT(s["notes"][0], HasSubstr("camera.time_offset_s = 0.025"));
}

TEST_F(CheckPage, SaysWhyASettingCouldNotBeWritten) {
  refuses_ = true;
  view_->findings(1, kFindings);
  EXPECT_EQ(post("/accept?setting=camera.time_offset_s").status, 500);
  EXPECT_THAT(state()["notes"][0], HasSubstr("read-only"));
  EXPECT_EQ(state()["findings"][1]["setting"], "camera.time_offset_s");
}

TEST_F(CheckPage, BeginsAnewWhenAsked) {
  watch(*view_, 60);
  EXPECT_FALSE(view_->takes_new_start());
  EXPECT_EQ(post("/again").status, 200);
  EXPECT_EQ(state()["camera"]["hz"], 0);
  EXPECT_EQ(state()["imu"]["turned_rad"][0], 0);
  EXPECT_TRUE(view_->takes_new_start());
  EXPECT_FALSE(view_->takes_new_start()) << "once";
  const Answer refused = ask(port(), "DELETE /again HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(refused.status, 405);
  EXPECT_THAT(refused.head, HasSubstr("\r\nAllow: GET, HEAD, POST\r\n"));
}

TEST_F(CheckPage, NothingIsWrittenForOtherComputers) {
  const auto view = must(CheckView::open({"0.0.0.0", 0}, {"flight.toml", "epiline test", 0, 0, false},
                                         [](const SettingHint&) -> Status { return Done{}; }));
  view->findings(1, kFindings);
  const std::uint16_t open_port = view->address().port;
  const std::string token = "token=" + view->address().token;
  EXPECT_EQ(get(open_port, "/state").status, 403) << "without the token";
  EXPECT_EQ(nlohmann::json::parse(get(open_port, "/state?" + token).body)["may_accept"], false);
  EXPECT_EQ(ask(open_port, "POST /accept?setting=camera.time_offset_s&" + token +
                               " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                .status,
            405);
}

TEST_F(CheckPage, LooksAsItShouldInABrowser) {
  BrowserTest::SetUp();
  if (IsSkipped()) return;
  watch(*view_, 60);
  view_->findings(3.5, kFindings);
  Browser browser(url_of(view_->address()), folder_);
  browser.expect_texts({">live<", "20.0 Hz", "200 Hz", "strongest at 50 Hz", "set camera.time_offset_s = 0.0250",
                        "Set it", "&lt;b&gt;noise&lt;/b&gt;"});
  const std::string page = browser.html();
  EXPECT_LT(page.find("time offset +25.0 ms"), page.find("30.00 images per second")) << "the worst first";
  const auto pixels = [](const cv::Mat& picture) {
    return std::array{count(picture, cv::Vec3b(77, 77, 77), 1), count(picture, cv::Vec3b(54, 90, 255), 12),
                      count(picture, cv::Vec3b(0xb7, 0x67, 0x16), 12)};
  };
  const auto is_whole = [&](const cv::Mat& picture) {
    const auto [image, tracks, spectrum] = pixels(picture);
    return image > 50'000 && tracks > 100 && spectrum > 200;
  };
  const cv::Mat picture = browser.photograph_when(is_whole);
  EXPECT_TRUE(is_whole(picture)) << testing::PrintToString(pixels(picture));
  EXPECT_EQ(browser.complaints(), "");
}

}  // namespace
}  // namespace epiline
