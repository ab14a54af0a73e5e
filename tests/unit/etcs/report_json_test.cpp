#include "etcs/report_json.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "unit/etcs/random_report.hpp"

namespace railfix::etcs::report_json_test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kCheckVector = "880601D6F345402AF34000E48F68EB84D250014010C38830";

nlohmann::ordered_json check_json() {
  return to_json(decode(parse_hex(kCheckVector).value(), Baseline::b3).value(), Baseline::b3);
}
std::string refusal(const nlohmann::ordered_json& json, Baseline baseline = Baseline::b3) {
  const auto report = report_from_json(json, baseline);
  return report.ok() ? "accepted" : report.error().message;
}

TEST(ReportJson, NamesTheFieldsInOrder) {
  EXPECT_EQ(check_json().dump(),
            R"({"NID_MESSAGE":136,"L_MESSAGE":24,"T_TRAIN":123456789,"NID_ENGINE":43981,"NID_PACKET":0,"L_PACKET":114,)"
            R"("Q_SCALE":1,"NID_LRBG":2019799,"NID_C":123,"NID_BG":4567,"D_LRBG":1234,"Q_DIRLRBG":1,"Q_DLRBG":1,)"
            R"("L_DOUBTOVER":10,"L_DOUBTUNDER":67,"Q_LENGTH":0,"V_TRAIN":28,"Q_DIRTRAIN":1,"M_MODE":0,"M_LEVEL":3})");
}

TEST(ReportJson, RandomReportsComeBack) {
  core::Random random(7);
  for (int i = 0; i < 500; ++i) {
    const auto baseline = i % 2 == 0 ? Baseline::b3 : Baseline::b4;
    const auto report = testing::random_report(random, baseline);
    const auto read = report_from_json(to_json(report, baseline), baseline);
    ASSERT_TRUE(read.ok()) << read.error().message;
    ASSERT_EQ(read.value(), report);
  }
}

TEST(ReportJson, LengthsMayBeLeftOutAndTheGroupGivenInTwoParts) {
  auto json = check_json();
  for (const char* key : {"NID_MESSAGE", "L_MESSAGE", "L_PACKET", "NID_LRBG"}) json.erase(key);
  EXPECT_EQ(to_hex(encode(report_from_json(json, Baseline::b3).value(), Baseline::b3).value()), kCheckVector);
  json.erase("NID_C");
  EXPECT_THAT(refusal(json), HasSubstr("NID_C is missing"));
}

TEST(ReportJson, EveryMissingFieldIsNamed) {
  const auto json = check_json();
  for (const char* key : {"T_TRAIN", "NID_ENGINE", "NID_PACKET", "Q_SCALE", "D_LRBG", "Q_DIRLRBG", "Q_DLRBG",
                          "L_DOUBTOVER", "L_DOUBTUNDER", "Q_LENGTH", "V_TRAIN", "Q_DIRTRAIN", "M_MODE", "M_LEVEL"}) {
    auto without = json;
    without.erase(key);
    const auto said = refusal(without);
    EXPECT_TRUE(said.find(key) != std::string::npos || said.find("Q_INTEGRITY") != std::string::npos)
        << key << ": " << said;
    EXPECT_THAT(said, HasSubstr("is missing"));
  }
}

TEST(ReportJson, WrongValuesAreNamed) {
  const auto with = [](const char* key, const nlohmann::ordered_json& value) {
    auto json = check_json();
    json[key] = value;
    return refusal(json);
  };
  EXPECT_THAT(with("D_LRBG", 32768), HasSubstr("D_LRBG = 32768 must be a whole number from 0 to 32767"));
  EXPECT_THAT(with("D_LRBG", -1), HasSubstr("D_LRBG = -1 must be"));
  EXPECT_THAT(with("D_LRBG", 1.5), HasSubstr("D_LRBG = 1.5 must be"));
  EXPECT_THAT(with("D_LRBG", "1"), HasSubstr("D_LRBG = \"1\" must be"));
  EXPECT_THAT(with("T_TRAIN", 4294967296), HasSubstr("T_TRAIN = 4294967296 must be"));
  EXPECT_THAT(with("Q_SCALE", 3), HasSubstr("Q_SCALE = 3 is a spare value"));
  EXPECT_THAT(with("NID_PACKET", 58), HasSubstr("NID_PACKET = 58, but the first packet"));
  EXPECT_THAT(with("L_PACKET", 115), HasSubstr("L_PACKET = 115, but with these fields it must be 114"));
  EXPECT_THAT(with("L_MESSAGE", 25), HasSubstr("L_MESSAGE = 25, but"));
  EXPECT_THAT(with("NID_MESSAGE", 132), HasSubstr("NID_MESSAGE = 132, but"));
  EXPECT_THAT(with("NID_LRBG", 1), HasSubstr("contradicts NID_C and NID_BG"));
  EXPECT_THAT(with("NID_PRVLRBG", 1), HasSubstr("NID_PRVLRBG goes only with NID_PACKET 1"));
  EXPECT_THAT(with("Q_LENGTH", 1), HasSubstr("L_TRAININT is missing"));
  EXPECT_THAT(with("V_TRIAN", 1), HasSubstr("Key \"V_TRIAN\""));
  EXPECT_THAT(with("Q_INTEGRITY", 0), HasSubstr("Key \"Q_INTEGRITY\""));
  EXPECT_THAT(with("packets", 1), HasSubstr("must be a list"));
  EXPECT_THAT(refusal(nlohmann::ordered_json::array()), HasSubstr("one JSON object"));
}

TEST(Packet58Json, RandomPacketsComeBack) {
  core::Random random(59);
  for (int i = 0; i < 200; ++i) {
    const auto parameters = testing::random_parameters(random);
    EXPECT_EQ(parameters_from_json(to_json(parameters)).value(), parameters);
  }
}

TEST(Packet58Json, WrongValuesAreNamed) {
  const auto with = [](const char* key, const nlohmann::ordered_json& value) {
    ReportParameters parameters;
    parameters.locations = {{500, 1}};
    auto json = to_json(parameters);
    json[key] = value;
    return parameters_from_json(json).error().message;
  };
  EXPECT_THAT(with("Q_DIR", 3), HasSubstr("Q_DIR = 3 is a spare value"));
  EXPECT_THAT(with("N_ITER", 2), HasSubstr("N_ITER = 2, but with these fields it must be 1"));
  EXPECT_THAT(with("L_PACKET", 56), HasSubstr("it must be 72"));
  EXPECT_THAT(with("locations", 1), HasSubstr("must be a list"));
  EXPECT_THAT(with("locations", {{{"D_LOC", 1}}}), HasSubstr("Q_LGTLOC is missing"));
  EXPECT_THAT(with("T_CYCLE", 1), HasSubstr("Key \"T_CYCLE\""));
}

}  // namespace
}  // namespace railfix::etcs::report_json_test
