#include "drivers/program/view/view_address.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(ViewAddress, IsLoopbackUnlessAnotherIsNamed) {
  const auto port = parse_view_address("8080");
  ASSERT_TRUE(port);
  EXPECT_EQ(port->host, "127.0.0.1");
  EXPECT_EQ(port->port, 8080);
  EXPECT_TRUE(port->is_loopback());
  EXPECT_EQ(url_of(*port), "http://127.0.0.1:8080/");
  const auto all = parse_view_address("0.0.0.0:0");
  ASSERT_TRUE(all);
  EXPECT_FALSE(all->is_loopback());
  EXPECT_EQ(url_of({"0.0.0.0", 99}), "http://127.0.0.1:99/");
  const auto v6 = parse_view_address("[::1]:65535");
  ASSERT_TRUE(v6);
  EXPECT_EQ(v6->host, "::1");
  EXPECT_TRUE(v6->is_loopback());
  EXPECT_EQ(url_of(*v6), "http://[::1]:65535/");
  EXPECT_EQ(parse_view_address("LocalHost:1")->host, "127.0.0.1");
}

TEST(ViewAddress, WhatIsNoneIsToldInOneLine) {
  for (const char* text :
       {"", ":", "80a", "-1", "65536", "99999999999", "127.0.0.1", "127.0.0.1:", ":8080", "drone:8080", "[::1:80",
        "[::1]80", "::1:80", "[127.0.0.1]:80", "1.2.3.4.5:80", " 80", "80 "}) {
    const auto address = parse_view_address(text);
    ASSERT_FALSE(address) << text;
    EXPECT_EQ(address.error().kind, ErrorKind::kUsage);
    EXPECT_EQ(address.error().text().find('\n'), std::string::npos);
    EXPECT_NE(address.error().text().find(std::string("--view ") + text), std::string::npos);
    EXPECT_NE(address.error().text().find("; expected "), std::string::npos);
  }
}

TEST(ViewAddress, NamesThatAreNotOursAreNoHost) {
  for (const char* host : {"localhost", "localhost:8080", "LOCALHOST:1", "127.0.0.1", "127.0.0.1:8080", "[::1]:8080",
                           "[::1]", "192.168.1.7:80"}) {
    EXPECT_TRUE(is_own_host(host, "drone", true)) << host;
  }
  for (const char* host : {"", "evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example",
                           "drone:8080", "drone.local", "localhost:80x", "localhost:80:80", "::1", "[::1", "[evil]:80",
                           "127.0.0.1:8080@evil.example", "0x7f.1", "2130706433"}) {
    EXPECT_FALSE(is_own_host(host, "drone", true)) << host;
  }
  EXPECT_TRUE(is_own_host("drone:8080", "drone", false));
  EXPECT_TRUE(is_own_host("Drone.local", "drone", false));
  EXPECT_FALSE(is_own_host("evil.example", "drone", false));
  EXPECT_FALSE(is_own_host(".local", "", false));
}

TEST(ViewAddress, AllInterfacesAreNamedByTheAddressesThatOthersReach) {
  EXPECT_EQ(urls_of({"192.168.1.7", 80, "ab12"}), std::vector<std::string>{"http://192.168.1.7:80/?token=ab12"});
  const std::vector<std::string> all = urls_of({"0.0.0.0", 99, "ab12"});
  ASSERT_FALSE(all.empty());
  for (const std::string& url : all) {
    EXPECT_EQ(url.find("0.0.0.0"), std::string::npos) << url;
    EXPECT_NE(url.find(":99/?token=ab12"), std::string::npos) << url;
    EXPECT_EQ(url.find("127.0.0.1") != std::string::npos, all.size() == 1 && url == url_of({"0.0.0.0", 99, "ab12"}));
  }
}

TEST(ViewAddress, AServedNetworkNeedsAToken) {
  const std::string token = new_token();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_NE(new_token(), token);
  EXPECT_EQ(url_of({"192.168.1.7", 80, "ab12"}), "http://192.168.1.7:80/?token=ab12");
  EXPECT_TRUE(is_token("ab12", "ab12"));
  for (const char* wrong : {"", "ab1", "ab13", "ab123", "AB12", "xb12"}) EXPECT_FALSE(is_token(wrong, "ab12")) << wrong;
}

}  // namespace
}  // namespace epiline
