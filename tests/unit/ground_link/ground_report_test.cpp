#include "ground_link/ground_report.hpp"

#include <gmock/gmock.h>

#include "core/random.hpp"
#include "ground_link/mqtt_client.hpp"

namespace railfix::ground_link {
namespace {

using ::testing::HasSubstr;

GroundReport example() {
  return {"demo", 0xFEDCBA9876543210ULL, 17,   1'700'000'000'000'000'001, 1'700'000'000'040'000'000, 4,
          5,      {0x88, 0, 1},          "cab"};
}

TEST(GroundReport, ComesBack) {
  EXPECT_EQ(ground_report_from(to_bytes(example())).value(), example());
}

TEST(GroundReport, WhatIsNoneIsRefused) {
  const std::vector<uint8_t> noise{0xFF, 0xFF, 0xFF};
  EXPECT_THAT(ground_report_from(noise).error().message, HasSubstr("3 bytes are no GroundReport"));
  auto report = example();
  report.baseline = 5;
  EXPECT_THAT(ground_report_from(to_bytes(report)).error().message, HasSubstr("Baseline 5"));
  report = example();
  report.message.clear();
  EXPECT_THAT(ground_report_from(to_bytes(report)).error().message, HasSubstr("no message"));
}

TEST(GroundReport, DamagedBytesAreRefusedOrAnotherReport) {
  core::Random random(9);
  const auto bytes = to_bytes(example());
  for (int i = 0; i < 20000; ++i) {
    auto damaged = bytes;
    damaged.resize(random.next() % (bytes.size() + 1));
    for (auto& byte : damaged) {
      if (random.next() % 8 == 0) byte = static_cast<uint8_t>(random.next());
    }
    const auto report = ground_report_from(damaged);
    ASSERT_TRUE(report.ok() || !report.error().message.empty());
  }
}

TEST(Broker, IsHostOrHostAndPort) {
  MqttOptions options;
  ASSERT_TRUE(parse_broker("ground.example", options).ok());
  EXPECT_EQ(options.host, "ground.example");
  EXPECT_EQ(options.port, 1883);
  ASSERT_TRUE(parse_broker("10.0.0.7:8883", options).ok());
  EXPECT_EQ(options.host, "10.0.0.7");
  EXPECT_EQ(options.port, 8883);
  for (const char* wrong : {"", ":1883", "host:", "host:0", "host:65536", "host:18x", "mqtt://host:1883", "[::1", "[]",
                            "[host]:1883", "[::1]1883", "[::1]:", "2001:db8::1:18830", "fe80::1%eth0:1883"})
    EXPECT_THAT(parse_broker(wrong, options).error().message, HasSubstr("localhost:1883")) << wrong;
}

TEST(Broker, MayBeAnIpv6Address) {
  for (const char* text : {"::1", "[::1]", "[::1]:8883", "2001:db8::17", "[fe80::1%eth0]:8883"}) {
    MqttOptions options;
    ASSERT_TRUE(parse_broker(text, options).ok()) << text;
    const bool with_port = std::string_view(text).ends_with(":8883");
    EXPECT_EQ(options.port, with_port ? 8883 : 1883);
    MqttOptions again;
    ASSERT_TRUE(parse_broker(broker_of(options), again).ok()) << broker_of(options);
    EXPECT_EQ(again.host, options.host);
    EXPECT_EQ(again.port, options.port);
  }
  MqttOptions options;
  ASSERT_TRUE(parse_broker("[::1]:8883", options).ok());
  EXPECT_EQ(options.host, "::1");
  EXPECT_EQ(broker_of(options), "[::1]:8883");
}

}  // namespace
}  // namespace railfix::ground_link
