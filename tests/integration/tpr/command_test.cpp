// `railfix tpr` as scripts use it: output, standard error, exit codes.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>

#include "support/program.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kCheckVector = "880601D6F345402AF34000E48F68EB84D250014010C38830";
constexpr double kPatienceS = 20;

test::Outcome tpr(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"railfix", "tpr"});
  return test::run_program(arguments, kPatienceS);
}

class TprCommand : public ::testing::Test {
 protected:
  ~TprCommand() override { std::filesystem::remove(file_); }
  std::string file_with(const std::string& text) {
    std::ofstream(file_) << text;
    return file_;
  }
  std::string file_ = std::filesystem::temp_directory_path() / ("tpr-" + std::to_string(getpid()) + ".json");
};

TEST_F(TprCommand, DecodesForPeople) {
  const auto outcome = tpr({"decode", kCheckVector});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("140 km/h"));
  EXPECT_THAT(outcome.out, HasSubstr("country/region 123, balise group 4567"));
  EXPECT_EQ(outcome.err, "");
}

TEST_F(TprCommand, DecodesAPacket58) {
  const auto outcome = tpr({"decode", "3A80908303E82103E9"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* said :
       {"SUBSET-026 3.6.5.1.5", "for trains that look: either way", "a report every 6 s", "a report every 1000 m",
        "a report at every LRBG", "500 m from the LRBG", "when passed by the max safe front end"}) {
    EXPECT_THAT(outcome.out, HasSubstr(said));
  }
  const auto json = tpr({"decode", "3A80908303E82103E9", "--json"});
  EXPECT_THAT(json.out, HasSubstr("\"D_CYCLOC\": 1000"));
  EXPECT_THAT(json.out, HasSubstr("\"Q_LGTLOC\": 1"));
  EXPECT_EQ(tpr({"decode", "3A80908303E821"}).exit_code, 2) << "cut";
  const auto often = tpr({"decode", "3A80908000002103E9"}).out;
  EXPECT_THAT(often, HasSubstr("a report as often as possible"));
}

TEST_F(TprCommand, WhatStandsBesideASpareValueIsPrinted) {
  const std::string hex = "880601D6F345402AF34000E48F68EB84D250014010CFA830";
  const auto outcome = tpr({"decode", hex});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.err, "railfix: V_TRAIN = 125 is a spare value.\n");
  EXPECT_THAT(outcome.out, HasSubstr("       125  a spare value\n"));
  EXPECT_THAT(outcome.out, HasSubstr("country/region 123, balise group 4567"));
  EXPECT_THAT(outcome.out, HasSubstr("         3  level 2\n"));
  EXPECT_THAT(tpr({"decode", hex, "--json"}).out, HasSubstr("\"V_TRAIN\": 125"));
  const auto packet = tpr({"decode", "3AC0908303E82103E9"});  // Q_DIR = 3
  EXPECT_EQ(packet.exit_code, 2);
  EXPECT_EQ(packet.err, "railfix: Q_DIR = 3 is a spare value.\n");
  EXPECT_THAT(packet.out, HasSubstr("500 m from the LRBG"));
}

TEST_F(TprCommand, TheLargestDistanceOfAPacket58IsADistance) {
  const auto outcome = tpr({"decode", "3A80917FFFFF21FFFF"});
  EXPECT_THAT(outcome.out, HasSubstr("not cyclic"));
  EXPECT_THAT(outcome.out, HasSubstr("327670 m from the LRBG"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("unknown")));
}

TEST_F(TprCommand, JsonGoesBothWays) {
  const auto json = tpr({"decode", kCheckVector, "--json"});
  EXPECT_EQ(json.exit_code, 0);
  EXPECT_THAT(json.out, StartsWith("{"));
  const auto hex = tpr({"encode", "--json", file_with(json.out)});
  EXPECT_EQ(hex.exit_code, 0);
  EXPECT_EQ(hex.out, std::string(kCheckVector) + "\n");
}

TEST_F(TprCommand, WrongInputGivesOneSentenceAndTwo) {
  for (const auto& arguments :
       std::vector<std::vector<std::string>>{{"decode", "88"},
                                             {"decode", "8"},
                                             {"decode", "zz"},
                                             {"decode", kCheckVector, "--baseline", "4"},
                                             {"encode", "--json", "/no/such/file"},
                                             {"encode", "--json", file_with("{\"T_TRAIN\": 1}")}}) {
    const auto outcome = tpr(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments[1];
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, StartsWith("railfix: "));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(TprCommand, SaysWhatIsWrongWithAFile) {
  const auto said = [](const std::string& file) { return tpr({"encode", "--json", file}).err; };
  EXPECT_EQ(said("/tmp"), "railfix: cannot read /tmp (Is a directory); is the path right?\n");
  EXPECT_EQ(said(file_with("{\n  \"T_TRAIN\": 1,\n}\n")), "railfix: " + file_ + ": not JSON at line 3, column 1.\n");
  const std::string deep = std::string(150'000, '[') + std::string(150'000, ']');
  EXPECT_EQ(said(file_with("{\"T_TRAIN\":" + deep + "}")),
            "railfix: " + file_ + ": its lists and objects nest more than 64 deep.\n");
}

TEST_F(TprCommand, SaysWhatContradictsItself) {
  const auto said = [](const std::string& file) { return tpr({"encode", "--json", file}).err; };
  EXPECT_EQ(said(file_with(R"({"T_TRAIN": 1, "NID_ENGINE": 2, "T_TRAIN": 3})")),
            "railfix: " + file_ + ": the key \"T_TRAIN\" is there twice in one object.\n");
}

TEST_F(TprCommand, WhatIsSaidOfAnUnknownGroupGoesBothWaysAndIsTold) {
  const std::string hex = "880601D6F345402AF34000E4FFFFFF84D250014010C38830";
  const auto json = tpr({"decode", hex, "--json"});
  EXPECT_EQ(json.exit_code, 0);
  EXPECT_THAT(json.err, StartsWith("remark: nothing is said by D_LRBG = 1234, Q_DIRLRBG = 1, Q_DLRBG = 1, "));
  EXPECT_THAT(json.err, HasSubstr("in relation to an LRBG that is unknown (NID_LRBG = 16777215).\n"));
  const auto back = tpr({"encode", "--json", file_with(json.out)});
  EXPECT_EQ(back.exit_code, 0);
  EXPECT_EQ(back.out, hex + "\n");
  EXPECT_EQ(back.err, json.err);
  EXPECT_EQ(tpr({"decode", hex}).err, json.err);
}

TEST_F(TprCommand, SaysWhichBaselineWouldFit) {
  EXPECT_THAT(tpr({"decode", kCheckVector, "--baseline", "4"}).err, HasSubstr("--baseline 3"));
  const auto file = file_with(tpr({"decode", kCheckVector, "--json"}).out);
  const auto outcome = tpr({"encode", "--json", file, "--baseline", "4"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr(" It fits --baseline 3.\n"));
}

TEST_F(TprCommand, TakesHexAsItIsPasted) {
  const std::string json = tpr({"decode", kCheckVector, "--json"}).out;
  const std::string rest = std::string(kCheckVector).substr(6);
  const auto said = [](std::vector<std::string> words) {
    words.insert(words.begin(), "decode");
    words.emplace_back("--json");
    return tpr(words).out;
  };
  EXPECT_EQ(said({"0x" + std::string(kCheckVector)}), json);
  EXPECT_EQ(said({"  " + std::string(kCheckVector) + "\n"}), json);
  EXPECT_EQ(said({"88", "06", "01", rest}), json);
  EXPECT_EQ(said({"0x88", "0x06 0x01", rest}), json);
  const std::string piped = "echo '88 06 01 " + rest + "' | " RAILFIX_BIN_DIR "/railfix tpr decode - --json";
  EXPECT_EQ(test::run_program({"/bin/sh", "-c", piped}, kPatienceS).out, json);
}

TEST_F(TprCommand, AnEmptyFileIsNamedSo) {
  EXPECT_THAT(tpr({"encode", "--json", file_with("\n")}).err, HasSubstr(file_ + ": is empty; give the fields"));
}

TEST_F(TprCommand, TheGroupOfAPacket58MayStandBeforeIt) {
  const auto said = [](const std::string& first, const std::string& second) {
    return tpr({"onboard", first, second, "--train", "tpr-command", "--domain", "79", "--for-s", "0.1"});
  };
  const std::string packet = "packet_58=3A80908303E82103E9";
  EXPECT_THAT(said("lrbg=1392643", packet).out, HasSubstr("packet 58 of 9 bytes from LRBG 1392643"));
  EXPECT_THAT(said(packet, "lrbg=1392643").out, HasSubstr("packet 58 of 9 bytes from LRBG 1392643"));
  EXPECT_THAT(said(packet, "lrbg=1392643.9").err,
              HasSubstr("lrbg=1392643.9: must be a whole number from 0 to 16777215"));
  EXPECT_THAT(said(packet, "ntc=1.9").err, HasSubstr("ntc=1.9: must be a whole number from 0 to 255"));
  EXPECT_THAT(said(packet, "length=0x10").err, HasSubstr("length=0x10: must be a number from 0 to 2000"));
  EXPECT_THAT(said(packet, "length=100.5").out, HasSubstr("length 100.5 m"));
}

}  // namespace
}  // namespace railfix
