// The run loop of a service, asked from outside.
#include "service/loop.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <stdexcept>

#include "core/time.hpp"

namespace railfix::service {
namespace {

TEST(Loop, ACommandWhoseHandlerThrowsIsAnsweredAndTheServiceGoesOn) {
  CommonConfig common;
  common.train_id = "loop-" + std::to_string(getpid());
  common.domain = 79;
  Loop loop("recorder", common, false);
  messaging::Writer<msg::ControlRequest> control(loop.participant(), messaging::topics::service_control);
  std::vector<msg::ControlReply> replies;
  loop.on<msg::ControlReply>(messaging::topics::service_reply, [&](const msg::ControlReply& reply) {
    replies.push_back(reply);
    if (replies.size() == 2) loop.finish("both are answered");
  });
  loop.on_command("throw", [](const std::string&) -> core::Result<std::string> { throw std::runtime_error("oh"); });
  loop.on_command("work", [](const std::string&) -> core::Result<std::string> { return std::string("done"); });
  const int64_t deadline_ns = core::monotonic_ns() + 30 * core::kNsPerSecond;
  loop.every(std::chrono::milliseconds(50), [&, sent = false]() mutable {
    if (core::monotonic_ns() > deadline_ns) loop.finish("nobody answers");
    if (sent || control.matched_readers() == 0) return;
    sent = true;
    for (const char* command : {"throw", "work"}) {
      msg::ControlRequest request;
      request.service("recorder");
      request.command(command);
      EXPECT_TRUE(control.write(request));
    }
  });
  loop.turn();
  ASSERT_EQ(replies.size(), 2U);
  EXPECT_FALSE(replies[0].done());
  EXPECT_EQ(std::string(replies[0].text().c_str()), "oh");
  EXPECT_TRUE(replies[1].done());
}

TEST(Loop, WhatItLogsIsCutBetweenTwoCharacters) {
  CommonConfig common;
  common.train_id = "long-log-" + std::to_string(getpid());
  common.domain = 79;
  Loop loop("recorder", common, false);
  std::string text;
  for (int i = 0; i < 700; ++i) text += "ü";
  std::string heard;
  loop.on<msg::LogRecord>(messaging::topics::log_record, [&](const msg::LogRecord& record) {
    heard = record.text().c_str();
    if (heard.starts_with("ü")) loop.finish("it is heard");
  });
  const int64_t deadline_ns = core::monotonic_ns() + 30 * core::kNsPerSecond;
  loop.every(std::chrono::milliseconds(200), [&] {
    if (core::monotonic_ns() > deadline_ns) loop.finish("nobody hears it");
    loop.log().info("{}", text);
  });
  loop.turn();
  EXPECT_EQ(heard, text.substr(0, 1022));
}

}  // namespace
}  // namespace railfix::service
