#pragma once
// A page in headless Chromium, where it is installed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace epiline {

namespace fs = std::filesystem;

class BrowserTest : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
    folder_ = fs::path(testing::TempDir()) / ("epiline_browser_" + std::to_string(getpid()) +
                                              testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  /// The page after four seconds of its own time; what it writes with `option`, and what the browser complained of. A
  /// browser that hangs is started anew: on a machine with many busy programs Chromium 156 often sleeps for ever, in
  /// all of its processes and without a connection to the page's server, which answers others at once.
  struct Look {
    std::string out, complaints;
  };
  Look look(const std::string& url, const std::string& option) const {
    int status = 0;
    for (int trial = 0; trial < kTrials && (trial == 0 || timed_out(status)); ++trial) {
      // a profile of its own: the one of a browser that was killed is locked
      const std::string profile = (folder_ / ("profile" + std::to_string(trial))).string();
      const std::string command =
          "timeout --kill-after=5 60 chromium --headless=new --no-sandbox --disable-gpu --hide-scrollbars "
          "--enable-logging=stderr --user-data-dir='" +
          profile + "' --window-size=1440,1600 --virtual-time-budget=4000 " + option + " " + url + " >'" +
          (folder_ / "out").string() + "' 2>'" + (folder_ / "err").string() + "'";
      status = std::system(command.c_str());
    }
    EXPECT_EQ(status, 0) << text("err");
    Look look{text("out"), ""};
    std::ifstream err(folder_ / "err");
    for (std::string line; std::getline(err, line);) {
      if (line.find("CONSOLE") != std::string::npos) look.complaints += line + "\n";
    }
    return look;
  }
  std::string text(const char* name) const {
    std::ifstream in(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  fs::path folder_;

 private:
  static constexpr int kTrials = 8;
  /// timeout(1): 124, or 128 + SIGKILL if the program did not end when it was asked to.
  static bool timed_out(int status) {
    return WIFEXITED(status) && (WEXITSTATUS(status) == 124 || WEXITSTATUS(status) == 137);
  }
};

}  // namespace epiline
