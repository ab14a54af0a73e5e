// What the server does with its connections, and that none of them ends it: real sockets, handlers of the test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <ctime>
#include <deque>
#include <mutex>
#include <thread>

#include "monitor/http_server.hpp"
#include "support/loopback.hpp"

namespace railfix::monitor {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

const std::string kHealth = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
const std::string kUpgrade =
    "GET /api/live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n";

class Connection {
 public:
  explicit Connection(uint16_t port) {
    const timeval patience{20, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    EXPECT_TRUE(test::connect_to_loopback(socket_, port));
  }
  ~Connection() { close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void say(const std::string& bytes) const { (void)send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// What comes until these bytes have come, or the connection is closed.
  [[nodiscard]] std::string hear(const std::string& until) const {
    std::string heard;
    char part[4096];
    ssize_t got = 0;
    while ((until.empty() || heard.find(until) == std::string::npos) &&
           (got = recv(socket_, part, sizeof part, 0)) > 0) {
      heard.append(part, static_cast<size_t>(got));
    }
    return heard;
  }
  /// By the server, at once or soon.
  [[nodiscard]] bool is_closed() const {
    char part[4096];
    ssize_t got = 0;
    while ((got = recv(socket_, part, sizeof part, 0)) > 0) {
    }
    return got == 0 || errno == ECONNRESET;
  }
  [[nodiscard]] std::string asked(const std::string& request, const std::string& until = "\n") const {
    say(request);
    return hear(until);
  }

 private:
  int socket_ = test::tcp_socket();
};

/// Leaves the process one more descriptor, for as long as it lives.
class OneMoreDescriptor {
 public:
  OneMoreDescriptor() {
    getrlimit(RLIMIT_NOFILE, &before_);
    const int lowest_free = dup(STDERR_FILENO);
    close(lowest_free);
    rlimit few = before_;
    few.rlim_cur = static_cast<rlim_t>(lowest_free) + 1;
    setrlimit(RLIMIT_NOFILE, &few);
  }
  ~OneMoreDescriptor() { setrlimit(RLIMIT_NOFILE, &before_); }
  OneMoreDescriptor(const OneMoreDescriptor&) = delete;
  OneMoreDescriptor& operator=(const OneMoreDescriptor&) = delete;

 private:
  rlimit before_{};
};

class HttpConnectionsTest : public ::testing::Test {
 protected:
  HttpConnectionsTest() {
    handlers_.request = [](const Request&, const std::function<void(Response)>& answer) {
      answer({200, "text/plain", "ok\n", "", "no-store"});
    };
    handlers_.upgrade = [](const Request&) { return Handlers::Upgrade{true, "", {}}; };
    handlers_.opened = [](const ClientPtr&) {};
    handlers_.message = [](const ClientPtr&, const std::string&, bool) {};
    handlers_.closed = [](const ClientPtr&, const std::string&) {};
    options_.request_time = options_.taken_time = std::chrono::hours(1);
    handlers_.handler_failed = [this](const std::string& why) { note(why); };
    handlers_.server_failed = [this](const std::string& why) { note("server: " + why); };
  }
  void start() {
    server_ = std::make_unique<HttpServer>(options_, handlers_);
    port_ = server_->listen(0, 0);
    server_->start();
  }
  void note(const std::string& why) {
    const std::lock_guard lock(mutex_);
    failures_.push_back(why);
  }
  std::vector<std::string> failures() {
    const std::lock_guard lock(mutex_);
    return failures_;
  }
  /// Waits until there are so many, at most 10 s.
  std::vector<std::string> failures(size_t number) {
    for (int i = 0; i < 2000 && failures().size() < number; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return failures();
  }
  void expect_health() const { EXPECT_THAT(Connection(port_).asked(kHealth, "ok\n"), EndsWith("ok\n")); }

  HttpOptions options_;
  Handlers handlers_;
  std::mutex mutex_;
  std::vector<std::string> failures_;
  uint16_t port_ = 0;
  std::unique_ptr<HttpServer> server_;  // goes first: its thread uses the rest
};

TEST_F(HttpConnectionsTest, ATargetThatIsNoPathIsRefused) {
  handlers_.request = [this](const Request& request, const std::function<void(Response)>& answer) {
    note(request.path);
    answer({200, "text/plain", "ok\n", "", "no-store"});
  };
  start();
  for (const std::string target : {"?x", "*", "http://a/", "x", "%2f"}) {
    EXPECT_THAT(Connection(port_).asked("GET " + target + " HTTP/1.1\r\nHost: a\r\n\r\n"), StartsWith("HTTP/1.1 400"))
        << target;
  }
  EXPECT_THAT(failures(), IsEmpty()) << "no handler is asked";
  expect_health();
}

TEST_F(HttpConnectionsTest, AHandlerThatThrowsCostsOneClientItsAnswer) {
  handlers_.request = [](const Request& request, const std::function<void(Response)>& answer) {
    if (request.path == "/bad") throw std::out_of_range("no such place");
    answer({200, "text/plain", "ok\n", "", "no-store"});
  };
  handlers_.upgrade = [](const Request&) -> Handlers::Upgrade { throw std::out_of_range("no such way"); };
  start();
  EXPECT_THAT(Connection(port_).asked("GET /bad HTTP/1.1\r\nHost: a\r\n\r\n"), StartsWith("HTTP/1.1 500"));
  EXPECT_THAT(Connection(port_).asked(kUpgrade), StartsWith("HTTP/1.1 500"));
  EXPECT_THAT(failures(), ElementsAre("no such place", "no such way"));
  expect_health();
}

TEST_F(HttpConnectionsTest, AViewerWhoseHandlerThrowsIsClosedWith1011) {
  handlers_.message = [](const ClientPtr&, const std::string&, bool) { throw std::out_of_range("no such word"); };
  handlers_.closed = [](const ClientPtr&, const std::string& why) { throw std::runtime_error("closed: " + why); };
  start();
  {
    const Connection viewer(port_);
    ASSERT_THAT(viewer.asked(kUpgrade, "\r\n\r\n"), StartsWith("HTTP/1.1 101"));
    const std::string masked_text("\x81\x81\0\0\0\0a", 7);
    EXPECT_THAT(viewer.asked(masked_text, "failed"), EndsWith("\x03\xF3the monitor failed"));
    viewer.say(std::string("\x88\x80\0\0\0\0", 6));
    EXPECT_EQ(viewer.hear(""), "");
  }
  EXPECT_THAT(failures(2), ElementsAre("no such word", "closed: the monitor failed"));
  expect_health();
}

TEST_F(HttpConnectionsTest, ARequestIsLocalWhenItsHostAndItsPageAreThisComputer) {
  handlers_.request = [](const Request& request, const std::function<void(Response)>& answer) {
    answer({200, "text/plain", request.local ? "local\n" : "foreign\n", "", "no-store"});
  };
  start();
  const auto who = [this](const std::string& host, const std::string& origin) {
    const std::string page = origin.empty() ? "" : "Origin: http://" + origin + "\r\n";
    const std::string answer =
        Connection(port_).asked("GET / HTTP/1.1\r\nConnection: close\r\nHost: " + host + "\r\n" + page + "\r\n", "");
    return answer.substr(answer.rfind("\r\n") + 2);
  };
  EXPECT_EQ(who("localhost:8080", ""), "local\n");
  EXPECT_EQ(who("localhost:8080", "127.0.0.1:8080"), "local\n");
  EXPECT_EQ(who("localhost:8080", "127.evil.example:8080"), "foreign\n");
  EXPECT_EQ(who("127.evil.example:8080", ""), "foreign\n");
}

TEST_F(HttpConnectionsTest, WhatNoHandlerAnswersForIsToldAndDoesNotEndTheProcess) {
  handlers_.request = [](const Request&, const std::function<void(Response)>&) { throw std::out_of_range("once"); };
  handlers_.handler_failed = [](const std::string& why) { throw std::runtime_error("twice after " + why); };
  start();
  const Connection client(port_);
  client.say(kHealth);
  EXPECT_THAT(failures(1), ElementsAre("server: twice after once"));
  server_.reset();
  EXPECT_EQ(client.hear(""), "") << "the server could be taken down in order";
}

const std::string kHalfARequest = "GET / HTTP/1.1\r\nX: ";

TEST_F(HttpConnectionsTest, TheOldestOfTooManyGoesAndTheNextIsAnswered) {
  options_.most_clients = 4;
  start();
  const Connection viewer(port_);
  ASSERT_THAT(viewer.asked(kUpgrade, "\r\n\r\n"), StartsWith("HTTP/1.1 101"));
  std::deque<Connection> others;
  for (int i = 0; i < 200; ++i) others.emplace_back(port_).say(kHalfARequest);
  expect_health();
  EXPECT_TRUE(others.front().is_closed());
  EXPECT_THAT(others.back().asked("y\r\n\r\n", "ok\n"), EndsWith("ok\n"));
  EXPECT_EQ(server_->clients(), 1U) << "a viewer does not give way";
}

TEST_F(HttpConnectionsTest, HalfARequestIsNotWaitedForForEver) {
  options_.request_time = std::chrono::milliseconds(100);
  start();
  const Connection slow(port_);
  slow.say(kHalfARequest);
  EXPECT_TRUE(slow.is_closed());
}

TEST_F(HttpConnectionsTest, AnAnswerThatNobodyTakesIsKeptOnceAndNotForEver) {
  const auto large = std::make_shared<const std::string>(30'000'000, 'a');
  handlers_.request = [large](const Request&, const std::function<void(Response)>& answer) {
    answer({200, "text/plain", "", "", "no-store", large});
  };
  options_.taken_time = std::chrono::seconds(2);
  start();
  const auto used_before = large.use_count();
  std::deque<Connection> others;
  for (int i = 0; i < 10; ++i) others.emplace_back(port_).say(kHealth);
  const auto wait_for_uses = [&](long more) {
    for (int i = 0; i < 2000 && large.use_count() != used_before + more; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return large.use_count() - used_before;
  };
  EXPECT_EQ(wait_for_uses(10), 10) << "each waits for its client";
  EXPECT_EQ(wait_for_uses(0), 0);
  for (const auto& other : others) EXPECT_TRUE(other.is_closed());
}

TEST_F(HttpConnectionsTest, WithoutDescriptorsItWaitsInsteadOfTryingAllTheTime) {
  start();
  std::optional<OneMoreDescriptor> few(std::in_place);
  const Connection waiting(port_);
  const std::clock_t before = std::clock();
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  EXPECT_LT(std::clock() - before, CLOCKS_PER_SEC / 20);
  few.reset();
  EXPECT_THAT(waiting.asked(kHealth, "ok\n"), EndsWith("ok\n"));
}

// Accepting wants a descriptor before it looks whether somebody waits: one is kept free beside the last client's.
TEST_F(HttpConnectionsTest, WithoutDescriptorsTheOldestGivesItsOwn) {
  start();
  const Connection oldest(port_);
  const Connection next(port_);
  for (const Connection* client : {&oldest, &next}) EXPECT_THAT(client->asked(kHealth, "ok\n"), EndsWith("ok\n"));
  const OneMoreDescriptor few;
  EXPECT_THAT(Connection(port_).asked(kHealth, "ok\n"), EndsWith("ok\n"));
  EXPECT_TRUE(oldest.is_closed());
}

}  // namespace
}  // namespace railfix::monitor
