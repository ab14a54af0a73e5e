// Files, ports and addresses; what goes over a WebSocket is tested with the real program in tests/integration/monitor.
#include "monitor/http_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/result.hpp"
#include "monitor/static_files.hpp"

namespace railfix::monitor {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

Request get(const std::string& path, const std::string& etag = "") {
  Request request;
  request.method = "GET";
  request.path = path;
  request.if_none_match = etag;
  return request;
}

class StaticFilesTest : public ::testing::Test {
 protected:
  StaticFilesTest() {
    fs::create_directories(folder_ / "page" / "assets");
    std::ofstream(folder_ / "page" / "index.html") << "<p>page</p>";
    std::ofstream(folder_ / "page" / "assets" / "a-1.js") << "let a;";
    std::ofstream(folder_ / "secret") << "secret";
  }
  ~StaticFilesTest() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / ("railfix-page-" + std::to_string(getpid()));
  StaticFiles files_{folder_ / "page"};
};

TEST_F(StaticFilesTest, GivesThePageWithTypeAndCaching) {
  const auto front = files_.get(get("/"));
  EXPECT_EQ(front.body, "<p>page</p>");
  EXPECT_THAT(front.type, HasSubstr("text/html"));
  EXPECT_EQ(front.cache_control, "no-cache");
  EXPECT_EQ(files_.get(get("/", front.etag)).status, 304U);
  EXPECT_EQ(files_.get(get("/", "\"other\"")).status, 200U);
  const auto script = files_.get(get("/assets/a-1.js"));
  EXPECT_THAT(script.type, HasSubstr("text/javascript"));
  EXPECT_THAT(script.cache_control, HasSubstr("immutable"));
}

TEST_F(StaticFilesTest, GivesNothingFromOutside) {
  for (const std::string path :
       {"", "/../secret", "/assets/../../secret", "//etc/passwd", "/..", "/assets", "/./../secret", "/none"}) {
    const auto answer = files_.get(get(path));
    EXPECT_EQ(answer.status, 404U) << path << ": " << answer.body;
  }
  EXPECT_EQ(files_.get(get(std::string("/index.html\0.js", 15))).status, 404U);
  auto post = get("/");
  post.method = "POST";
  EXPECT_EQ(files_.get(post).status, 405U);
}

TEST_F(StaticFilesTest, SaysThatThePageWasNotBuilt) {
  const auto front = StaticFiles(folder_ / "nowhere").get(get("/"));
  EXPECT_EQ(front.status, 200U);
  EXPECT_THAT(front.body, HasSubstr("was not built"));
}

TEST(Url, IsDecoded) {
  EXPECT_EQ(url_decoded("/a%20b+c%2F%zz%4"), "/a b c/%zz%4");
}

// A page whose own name points to this computer is called by that name (DNS rebinding).
TEST(ThisComputer, IsLocalhostOrALoopbackAddressAndNoNameThatLooksLikeOne) {
  for (const std::string host :
       {"localhost", "localhost:8080", "127.0.0.1", "127.0.0.1:8080", "127.8.9.10:1", "[::1]", "[::1]:8080", "::1"}) {
    EXPECT_TRUE(names_this_computer(host)) << host;
  }
  for (const std::string host :
       {"", "127.evil.example", "127.evil.example:8080", "127.0.0.1.evil.example:8080", "127.1",
        "localhost.evil.example", "[::2]:8080", "::1.evil.example", "192.0.2.1:8080", "[", "null", ":8080"}) {
    EXPECT_FALSE(names_this_computer(host)) << host;
  }
  EXPECT_EQ(host_of("http://127.0.0.1:8080"), "127.0.0.1:8080");
  EXPECT_EQ(host_of("null"), "null");
}

TEST(Ports, AreSearchedAndRefusedWithASentence) {
  HttpServer first({}, {});
  const uint16_t taken = first.listen(0, 0);
  HttpServer second({}, {});
  EXPECT_GT(second.listen(taken, 50), taken);
  HttpServer third({}, {});
  try {
    third.listen(taken, 0);
    FAIL() << "took a port twice";
  } catch (const core::BadInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("port " + std::to_string(taken) + " of 127.0.0.1 is taken; set monitor.port"));
  }
  HttpOptions options;
  options.address = "not an address";
  EXPECT_THROW(HttpServer(options, {}).listen(0, 0), core::BadInput);
  options.address = "192.0.2.1";  // for documentation, RFC 5737: never ours
  EXPECT_THROW(HttpServer(options, {}).listen(0, 0), core::BadInput);
}

}  // namespace
}  // namespace railfix::monitor
