// Samples made by the generated code are decoded by the layout of the IDL alone, and must say the same.
#include "cdr/decode.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "core/random.hpp"
#include "messaging/topics.hpp"

namespace railfix::cdr {

namespace {

using nlohmann::ordered_json;
using ::testing::HasSubstr;

template <class T>
ordered_json decoded(const T& sample, const DecodeOptions& options = {}) {
  const auto result = decode(own_types(), messaging::type_of<T>().name(), messaging::serialize(sample), options);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.value();
}

TEST(Decode, EveryTopicsLayoutHasTheLengthOfItsSamples) {
  for (const auto& topic : messaging::all_topics()) {
    const auto cdr = topic.type->serialize(topic.type->make().get());
    const auto whole = decode(own_types(), topic.type->name(), cdr);
    EXPECT_TRUE(whole.ok()) << whole.error().message;
    const auto cut = decode(own_types(), topic.type->name(), std::span(cdr).first(cdr.size() - 1));
    EXPECT_FALSE(cut.ok()) << topic.name << " has bytes that its layout does not know";
  }
}

TEST(Decode, TrackViewFieldByField) {
  msg::TrackView view;
  view.stamp_ns(1'700'000'000'123'456'789);
  view.grabbed_ns(-5);
  view.frame_seq(std::numeric_limits<uint64_t>::max());
  view.roll_rad(0.01);
  view.pitch_rad(0.02);
  view.yaw_rad(-0.03);
  view.lateral_m(0.04);
  view.height_m(2.5);
  view.curvature_per_m(1.0 / 300);
  view.vertical_curvature_per_m(-1e-4);
  for (size_t i = 0; i < 28; ++i) view.covariance()[i] = 0.5 * static_cast<double>(i);
  view.condition(12.5);
  for (size_t i = 0; i < 16; ++i) {
    view.left_u_px()[i] = static_cast<float>(i);
    view.left_v_px()[i] = static_cast<float>(i) + 0.25F;
    view.right_u_px()[i] = static_cast<float>(i) + 100;
    view.right_v_px()[i] = static_cast<float>(i) + 200;
  }
  view.left_points(11);
  view.right_points(12);
  view.residual_px(0.75F);
  view.confidence(0.5F);
  view.seen_left(1);
  view.seen_right(0);
  view.mount_drifted(1);

  const auto json = decoded(view);
  EXPECT_EQ(json["stamp_ns"], view.stamp_ns());
  EXPECT_EQ(json["grabbed_ns"], -5);
  EXPECT_EQ(json["frame_seq"], view.frame_seq());
  EXPECT_EQ(json["roll_rad"], 0.01);
  EXPECT_EQ(json["pitch_rad"], 0.02);
  EXPECT_EQ(json["yaw_rad"], -0.03);
  EXPECT_EQ(json["lateral_m"], 0.04);
  EXPECT_EQ(json["height_m"], 2.5);
  EXPECT_EQ(json["curvature_per_m"], 1.0 / 300);
  EXPECT_EQ(json["vertical_curvature_per_m"], -1e-4);
  EXPECT_EQ(json["covariance"], ordered_json(view.covariance()));
  EXPECT_EQ(json["condition"], 12.5);
  EXPECT_EQ(json["left_u_px"], ordered_json(view.left_u_px()));
  EXPECT_EQ(json["left_v_px"], ordered_json(view.left_v_px()));
  EXPECT_EQ(json["right_u_px"], ordered_json(view.right_u_px()));
  EXPECT_EQ(json["right_v_px"], ordered_json(view.right_v_px()));
  EXPECT_EQ(json["left_points"], 11);
  EXPECT_EQ(json["right_points"], 12);
  EXPECT_EQ(json["residual_px"], 0.75);
  EXPECT_EQ(json["confidence"], 0.5);
  EXPECT_EQ(json["seen_left"], 1);
  EXPECT_EQ(json["seen_right"], 0);
  EXPECT_EQ(json["mount_drifted"], 1);
  EXPECT_FALSE(json.contains("padding"));
  EXPECT_EQ(json.begin().key(), "stamp_ns") << "members keep the order of the IDL";
}

TEST(Decode, ServiceStatusFieldByField) {
  // Texts of every length modulo 8 move what follows them across all alignments.
  for (size_t length = 0; length <= 32; ++length) {
    msg::ServiceStatus status;
    status.service(std::string(length, 's'));
    status.host("coach");
    status.stamp_ns(42);
    status.frames_in(1);
    status.frames_out(2);
    status.dropped(3);
    status.latency_p50_ms(4.5);
    status.latency_p99_ms(5.5);
    status.cpu_percent(6.5);
    status.rss_mb(7.5);
    status.pid(8);
    status.state(msg::STATE_DEGRADED);
    status.version("1.2.3");
    status.reason("no \xff camera");
    const auto json = decoded(status);
    EXPECT_EQ(json["service"], std::string(length, 's'));
    EXPECT_EQ(json["host"], "coach");
    EXPECT_EQ(json["stamp_ns"], 42);
    EXPECT_EQ(json["frames_in"], 1);
    EXPECT_EQ(json["frames_out"], 2);
    EXPECT_EQ(json["dropped"], 3);
    EXPECT_EQ(json["latency_p50_ms"], 4.5);
    EXPECT_EQ(json["latency_p99_ms"], 5.5);
    EXPECT_EQ(json["cpu_percent"], 6.5);
    EXPECT_EQ(json["rss_mb"], 7.5);
    EXPECT_EQ(json["pid"], 8);
    EXPECT_EQ(json["state"], 3);
    EXPECT_EQ(json["version"], "1.2.3");
    EXPECT_EQ(json["reason"], "no \xef\xbf\xbd camera") << "what is not UTF-8 is replaced";
  }
}

TEST(Decode, OctetsBecomeHexadecimalAndLongOnesAreCut) {
  msg::CameraPreview preview;
  preview.width_px(640);
  preview.jpeg(std::vector<uint8_t>(1000, 0xAB));
  DecodeOptions options;
  options.octets_shown = 3;
  EXPECT_EQ(decoded(preview, options)["jpeg"], "ababab... (1000 bytes)");
  EXPECT_EQ(decoded(preview, options)["width_px"], 640);
  preview.jpeg({1, 0xFE});
  EXPECT_EQ(decoded(preview)["jpeg"], "01fe");

  msg::TrainPositionReport report;
  report.message()[0] = 0x88;
  report.d_lrbg_m(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(decoded(report)["message"].get<std::string>(), ::testing::StartsWith("8800"));
  EXPECT_THAT(decoded(report).dump(), HasSubstr("\"d_lrbg_m\":null"));

  msg::ControlReply reply;
  reply.done(true);
  EXPECT_EQ(decoded(reply)["done"], true);
}

TEST(Decode, ConstantsCanBeNamed) {
  DecodeOptions options;
  options.name_constants = true;
  msg::OdometryStep step;
  step.mode(msg::ODOMETRY_KEYFRAME);
  EXPECT_EQ(decoded(step, options)["mode"], "KEYFRAME");
  step.mode(77);
  EXPECT_EQ(decoded(step, options)["mode"], 77);
  msg::TrainState state;
  state.sources(msg::SOURCE_CAMERA | msg::SOURCE_GNSS);
  EXPECT_EQ(decoded(state, options)["sources"], "CAMERA|GNSS");
  state.sources(0);
  EXPECT_EQ(decoded(state, options)["sources"], 0);
  EXPECT_EQ(decoded(state)["sources"], 0);
}

TEST(Decode, ReadsBigEndianToo) {
  Types types;
  ASSERT_TRUE(types.add("struct A { octet x; long y; sequence<short> z; };").ok());
  const std::vector<uint8_t> cdr{0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 2, 0, 1, 0xFF, 0xFF};
  const auto json = decode(types, "A", cdr);
  ASSERT_TRUE(json.ok()) << json.error().message;
  EXPECT_EQ(json.value().dump(), R"({"x":7,"y":258,"z":[1,-1]})");
}

TEST(Decode, GarbageIsRefusedWithTheMembersName) {
  const auto message = [](const std::vector<uint8_t>& cdr) {
    const auto result = decode(own_types(), "railfix::msg::ControlReply", cdr);
    return result.ok() ? std::string("no error") : result.error().message;
  };
  EXPECT_THAT(message({}), HasSubstr("plain CDR header"));
  EXPECT_THAT(message({0, 3, 0, 0, 1, 2, 3, 4}), HasSubstr("plain CDR header"));
  EXPECT_THAT(message({0, 1, 0, 0, 1, 2, 3}), HasSubstr("request_id does not fit"));
  EXPECT_THAT(message({0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 20, 0, 0, 0, 'a'}), HasSubstr("service does not fit"));
  EXPECT_THAT(message({0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 200, 0, 0, 0, 'a'}), HasSubstr("at most 32"));
  EXPECT_FALSE(decode(own_types(), "railfix::msg::NoSuch", std::vector<uint8_t>{0, 1, 0, 0}).ok());
}

TEST(Decode, RandomBytesNeverCrash) {
  core::Random random(11);
  for (int round = 0; round < 200; ++round) {
    for (const auto& topic : messaging::all_topics()) {
      std::vector<uint8_t> cdr(4 + random.next() % 400);
      for (auto& byte : cdr) byte = static_cast<uint8_t>(random.next() % 3 == 0 ? random.next() : 0);
      cdr[0] = 0;
      cdr[1] = static_cast<uint8_t>(round % 2);
      (void)decode(own_types(), topic.type->name(), cdr);
    }
  }
}

TEST(Decode, HostileLayoutsEnd) {
  Types types;
  ASSERT_TRUE(types.add("struct A { long x[4000000000][4000000000]; }; struct B { A many[65535][65535]; };").ok());
  const std::vector<uint8_t> cdr(1000, 0);
  EXPECT_FALSE(decode(types, "A", cdr).ok());
  EXPECT_FALSE(decode(types, "B", cdr).ok());
}

TEST(Decode, SequencesCountForTheDepth) {
  // Structures hide the sequences from each other: one element each.
  std::string text = "struct S0 { octet x; };\n";
  for (int i = 1; i <= 20; ++i) {
    text += "struct S" + std::to_string(i) + " { sequence<S" + std::to_string(i - 1) + "> x; };\n";
  }
  Types types;
  ASSERT_TRUE(types.add(text).ok());
  std::vector<uint8_t> cdr{0, 1, 0, 0};
  for (int i = 0; i < 20; ++i) cdr.insert(cdr.end(), {1, 0, 0, 0});
  cdr.push_back(7);
  EXPECT_TRUE(decode(types, "S15", std::span(cdr)).ok());
  const auto deep = decode(types, "S20", cdr);
  ASSERT_FALSE(deep.ok());
  EXPECT_THAT(deep.error().message, HasSubstr("nest too deeply"));
}

}  // namespace

}  // namespace railfix::cdr
