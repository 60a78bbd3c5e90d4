#pragma once
// A page in headless Chromium, where it is installed.
#include <gtest/gtest.h>
#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace epiline {

/// A browser of one page, told what to do through a file (Chrome DevTools Protocol), so that a test asks until the page
/// is what it waits for, in place of looking once after some time. (Chromium's own `--dump-dom` with
/// `--virtual-time-budget` stops for ever on a busy machine while the page waits for the server's next state.)
class Browser {
 public:
  /// Opens `url`. `profile`: a folder for what the browser keeps.
  Browser(const std::string& url, const std::filesystem::path& profile);
  ~Browser();
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  /// Waits until the page holds each of `texts`, as HTML writes them; fails the test, and tells what is missing, after
  /// a minute.
  void expect_texts(const std::vector<std::string>& texts);
  /// Waits until a photograph of the page passes `is_right`; gives the last one.
  cv::Mat photograph_when(const std::function<bool(const cv::Mat&)>& is_right);
  std::string html();
  /// Errors and warnings of the page so far, a line each.
  const std::string& complaints() const { return complaints_; }

 private:
  /// The answer to a command of the protocol; empty, and the test fails, if there is none.
  nlohmann::json ask(const char* method, const nlohmann::json& parameters = nlohmann::json::object());
  /// The browser's next message. Null: it has gone, or said nothing for a minute.
  nlohmann::json next_message();
  void note_complaint(const nlohmann::json& message);

  pid_t child_ = -1;
  int socket_ = -1;
  int asked_ = 0;
  std::string page_;      ///< the protocol's name for the session with the page
  std::string received_;  ///< bytes of messages that are not whole yet
  std::string complaints_;
};

/// Number of pixels whose colours are within the tolerance.
int count(const cv::Mat& picture, const cv::Vec3b& bgr, int tolerance);

class BrowserTest : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  std::filesystem::path folder_;
};

}  // namespace epiline
