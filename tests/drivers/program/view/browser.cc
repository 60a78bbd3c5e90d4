#include "tests/drivers/program/view/browser.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string_view>
#include <thread>

namespace epiline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::chrono::seconds kPatience{60};  // a guard against hanging for ever, nothing that is measured
constexpr std::chrono::milliseconds kBetweenLooks{100};

/// Calls `is_done` until it is, or patience ends.
bool wait_until(const std::function<bool()>& is_done) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!is_done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kBetweenLooks);
  }
  return true;
}

std::vector<std::uint8_t> from_base64(const std::string& text) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  std::uint32_t bits = 0;
  int n_bits = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) break;  // the padding
    bits = (bits << 6 | static_cast<std::uint32_t>(digit)) & 0xffffff;
    if ((n_bits += 6) >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (n_bits -= 8)));
  }
  return bytes;
}

}  // namespace

Browser::Browser(const std::string& url, const fs::path& profile) {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) throw std::runtime_error("no socket pair");
  socket_ = ends[0];
  // above the numbers that it gets: a file that keeps its number would be closed at the start of the program
  const int of_browser = fcntl(ends[1], F_DUPFD_CLOEXEC, 5);
  close(ends[1]);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, of_browser, 3);  // reads commands here ...
  posix_spawn_file_actions_adddup2(&files, of_browser, 4);  // ... and answers here
  posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
  posix_spawnattr_t group_of_its_own;
  posix_spawnattr_init(&group_of_its_own);
  posix_spawnattr_setflags(&group_of_its_own, POSIX_SPAWN_SETPGROUP);
  const std::string folder = "--user-data-dir=" + profile.string();
  const std::array<const char*, 9> arguments{"chromium",      "--headless=new",          "--no-sandbox",
                                             "--disable-gpu", "--hide-scrollbars",       "--remote-debugging-pipe",
                                             folder.c_str(),  "--window-size=1440,1600", nullptr};
  const int error =
      posix_spawnp(&child_, arguments[0], &files, &group_of_its_own, const_cast<char**>(arguments.data()), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&group_of_its_own);
  close(of_browser);
  if (error != 0) throw std::runtime_error("chromium does not start");

  const std::string target = ask("Target.createTarget", {{"url", "about:blank"}}).value("targetId", "");
  page_ = ask("Target.attachToTarget", {{"targetId", target}, {"flatten", true}}).value("sessionId", "");
  ask("Runtime.enable");
  ask("Log.enable");
  ask("Page.navigate", {{"url", url}});
}

Browser::~Browser() {
  close(socket_);
  if (child_ <= 0) return;
  kill(-child_, SIGKILL);
  while (waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

json Browser::ask(const char* method, const json& parameters) {
  json command{{"id", ++asked_}, {"method", method}, {"params", parameters}};
  if (!page_.empty()) command["sessionId"] = page_;
  const std::string bytes = command.dump() + '\0';
  if (send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(bytes.size())) {
    ADD_FAILURE() << "the browser takes no " << method;
    return json::object();
  }
  for (;;) {
    const json message = next_message();
    if (message.is_null()) {
      ADD_FAILURE() << "the browser does not answer " << method;
      return json::object();
    }
    if (message.value("id", 0) == asked_) return message.value("result", json::object());
    note_complaint(message);
  }
}

json Browser::next_message() {
  std::size_t end = 0;
  while ((end = received_.find('\0')) == std::string::npos) {
    pollfd readable{socket_, POLLIN, 0};
    if (poll(&readable, 1, std::chrono::milliseconds(kPatience).count()) <= 0) return nullptr;
    std::array<char, 65536> buffer{};
    const ssize_t n = read(socket_, buffer.data(), buffer.size());
    if (n <= 0) return nullptr;
    received_.append(buffer.data(), static_cast<std::size_t>(n));
  }
  const json message = json::parse(received_.substr(0, end));
  received_.erase(0, end + 1);
  return message;
}

void Browser::note_complaint(const json& message) {
  const std::string method = message.value("method", "");
  if (method == "Runtime.exceptionThrown" || method == "Runtime.consoleAPICalled" || method == "Log.entryAdded") {
    complaints_ += message["params"].dump() + "\n";
  }
}

std::string Browser::html() {
  const json answer = ask("Runtime.evaluate", {{"expression", "document.body.innerHTML"}, {"returnByValue", true}});
  return answer.value(json::json_pointer("/result/value"), "");
}

void Browser::expect_texts(const std::vector<std::string>& texts) {
  std::string page;
  const auto missing = [&] {
    std::string all;
    for (const std::string& text : texts) {
      if (page.find(text) == std::string::npos) all += "\n  " + text;
    }
    return all;
  };
  wait_until([&] { return page = html(), testing::Test::HasFailure() || missing().empty(); });
  EXPECT_EQ(missing(), "") << "of the page " << page << "\nwhich complains of " << complaints_;
}

cv::Mat Browser::photograph_when(const std::function<bool(const cv::Mat&)>& is_right) {
  cv::Mat picture;
  wait_until([&] {
    const std::string png = ask("Page.captureScreenshot").value("data", "");
    picture = png.empty() ? cv::Mat() : cv::imdecode(from_base64(png), cv::IMREAD_COLOR);
    return testing::Test::HasFailure() || (!picture.empty() && is_right(picture));
  });
  return picture;
}

int count(const cv::Mat& picture, const cv::Vec3b& bgr, int tolerance) {
  cv::Mat is_like;
  cv::inRange(picture, cv::Scalar(bgr) - cv::Scalar::all(tolerance), cv::Scalar(bgr) + cv::Scalar::all(tolerance),
              is_like);
  return cv::countNonZero(is_like);
}

void BrowserTest::SetUp() {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
  folder_ = fs::path(testing::TempDir()) / ("epiline_browser_" + std::to_string(getpid()) +
                                            testing::UnitTest::GetInstance()->current_test_info()->name());
  fs::create_directories(folder_);
}

void BrowserTest::TearDown() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace epiline
