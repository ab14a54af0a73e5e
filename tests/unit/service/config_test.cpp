#include "service/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "service/service.hpp"
#include "support/every_setting.hpp"

namespace railfix::service {
namespace {

using ::testing::HasSubstr;

using Config = test::EverySetting;

class ConfigTest : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& text) {
    const auto file = std::filesystem::path(::testing::TempDir()) / "railfix_config_test.yaml";
    std::ofstream(file) << text;
    return file;
  }
  static std::string error_of(const core::Result<Config>& result) {
    return result.ok() ? "no error" : result.error().message;
  }
};

TEST_F(ConfigTest, ReadsEveryKindOfKeyAndLeavesDefaults) {
  const auto config = read_config<Config>("odometry", write("odometry:\n  speed_mps: 2.5\n  count: 5\n  on: false\n  "
                                                            "mode: b\n  names: [p, q]\n  inner:\n    inner_m: 0.5\n"));
  ASSERT_TRUE(config.ok()) << error_of(config);
  EXPECT_EQ(config.value().speed_mps, 2.5);
  EXPECT_EQ(config.value().count, 5);
  EXPECT_FALSE(config.value().on);
  EXPECT_EQ(config.value().mode, "b");
  EXPECT_EQ(config.value().name, "x");
  EXPECT_THAT(config.value().names, ::testing::ElementsAre("p", "q"));
  EXPECT_EQ(config.value().inner_m, 0.5);
}

TEST_F(ConfigTest, NamesFileLineKeyAndReason) {
  const auto file = write("odometry:\n  speed_mps: 200\n  cuont: 3\n  inner: {inner_m: far}\n");
  const auto config = read_config<Config>("odometry", file);
  ASSERT_FALSE(config.ok());
  EXPECT_THAT(error_of(config), HasSubstr(file.string() + " line 2: odometry.speed_mps 200 is outside 0 to 100 m/s"));
  EXPECT_THAT(error_of(config), HasSubstr("line 3: odometry.cuont is not a key of this section; did you mean count?"));
  EXPECT_THAT(error_of(config), HasSubstr("line 4: odometry.inner.inner_m 'far' is not a number; give it in m"));
}

TEST_F(ConfigTest, RefusesNotANumberAndWrongKinds) {
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: {speed_mps: .nan}\n")).ok());
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: {count: 2.5}\n")).ok());
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: {count: [1]}\n")).ok());
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: {mode: c}\n")).ok());
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: [1, 2]\n")).ok());
  EXPECT_FALSE(read_config<Config>("odometry", write("odometry: {inner: 3}\n")).ok());
}

TEST_F(ConfigTest, CommandLineIsOverTheFile) {
  const auto file = write("odometry: {speed_mps: 1, inner: {inner_m: 0.5}}\n");
  const auto config = read_config<Config>(
      "odometry", file, {{"odometry.speed_mps", "7"}, {"odometry.inner.inner_m", "1.5"}, {"fusion.x", "1"}});
  ASSERT_TRUE(config.ok()) << error_of(config);
  EXPECT_EQ(config.value().speed_mps, 7);
  EXPECT_EQ(config.value().inner_m, 1.5);
  const auto wrong = read_config<Config>("odometry", file, {{"odometry.speed", "7"}});
  EXPECT_THAT(error_of(wrong), HasSubstr("odometry.speed is not a key"));
  const auto outside = read_config<Config>("odometry", file, {{"odometry.speed_mps", "700"}});
  EXPECT_THAT(error_of(outside), HasSubstr("command line: odometry.speed_mps 700 is outside"));
}

TEST_F(ConfigTest, CommandLineRefusesAKeyBelowAValue) {
  const auto file = write("odometry: {name: a}\n");
  EXPECT_THAT(error_of(read_config<Config>("odometry", file, {{"odometry.name.x", "1"}})),
              HasSubstr("command line: odometry.name.x: what stands before the last dot is a value, not a section"));
  EXPECT_FALSE(read_config<Config>("odometry", {}, {{"odometry.name", "a"}, {"odometry.name.x.y", "1"}}).ok());
}

TEST_F(ConfigTest, CommandLineTakesListsAndEmptyTexts) {
  const auto config = read_config<Config>("odometry", {}, {{"odometry.names", "[p, q]"}, {"odometry.name", ""}});
  ASSERT_TRUE(config.ok()) << error_of(config);
  EXPECT_THAT(config.value().names, ::testing::ElementsAre("p", "q"));
  EXPECT_EQ(config.value().name, "");
}

TEST_F(ConfigTest, OneFileConfiguresAWholeTrain) {
  const auto file = write("common: {domain: 3}\nfusion: {anything: 1}\nodometry: {count: 2}\n");
  EXPECT_TRUE(read_config<Config>("odometry", file, {}, {"fusion"}).ok());
  EXPECT_THAT(error_of(read_config<Config>("odometry", file, {}, {})),
              HasSubstr("section fusion belongs to no service; there are common"));
}

TEST_F(ConfigTest, MissingAndBrokenFilesAreSentences) {
  EXPECT_THAT(error_of(read_config<Config>("odometry", "/no/such.yaml")), HasSubstr("/no/such.yaml does not exist"));
  EXPECT_THAT(error_of(read_config<Config>("odometry", "/tmp")), HasSubstr("/tmp is a folder"));
  EXPECT_THAT(error_of(read_config<Config>("odometry", write("odometry: {a: [\n"))), HasSubstr("not valid YAML"));
  EXPECT_THAT(error_of(read_config<Config>("odometry", write("just text\n"))), HasSubstr("sections"));
  EXPECT_THAT(error_of(read_config<Config>("odometry", write(""))),
              HasSubstr("is empty, as a power cut leaves a file"));
  EXPECT_EQ(error_of(read_config<Config>("odometry", write("# the defaults\n"))), "no error");
}

TEST_F(ConfigTest, DocumentationIsAValidConfigurationWithTheDefaults) {
  const std::string text = document_config<Config>("odometry");
  EXPECT_THAT(text, HasSubstr("# How fast. [m/s, 0 to 100]\n  speed_mps: 10\n"));
  const auto config = read_config<Config>("odometry", write(text));
  ASSERT_TRUE(config.ok()) << error_of(config);
  EXPECT_EQ(config.value().speed_mps, 10);
}

struct LargeNumbers {
  int64_t nid = 0;
  double way_m = 2e6;
  void describe(Fields& fields) {
    fields.integer("nid", nid, {0, 16777215}, "", "Identity.");
    fields.number("way_m", way_m, {1e-5, 1e7}, "m", "Way.");
  }
};

TEST_F(ConfigTest, WholeNumbersAreWrittenInFull) {
  EXPECT_THAT(document_config<LargeNumbers>("odometry"),
              HasSubstr("# Identity. [0 to 16777215]\n  nid: 0\n  # Way. [m, 1e-05 to 10000000]\n  way_m: 2000000\n"));
  const auto config = read_config<LargeNumbers>("odometry", write("odometry: {nid: 16777216}\n"));
  ASSERT_FALSE(config.ok());
  EXPECT_THAT(config.error().message, HasSubstr("odometry.nid 16777216 is outside 0 to 16777215"));
}

TEST_F(ConfigTest, WhatTheParserWouldLeaveOutIsRefused) {
  const auto told = [&](const std::string& text) {
    return error_of(read_config<Config>("odometry", write(text), {}, {"fusion"}));
  };
  EXPECT_THAT(told("odometry:\n  speed_mps: 1\n  inner: {inner_m: 0.5}\n  speed_mps: 2\n"),
              HasSubstr(".yaml: odometry.speed_mps is given twice, lines 2 and 4; remove one"));
  EXPECT_THAT(told("odometry: {inner: {inner_m: 0.5, inner_m: 1}}\n"),
              HasSubstr("odometry.inner.inner_m is given twice, line 1; remove one"));
  EXPECT_THAT(told("odometry: {count: 2}\nfusion: {a: [{b: 1, b: 2}]}\nodometry: {count: 3}\n"),
              ::testing::AllOf(HasSubstr("odometry is given twice, lines 1 and 3; remove one"),
                               HasSubstr("fusion.a.b is given twice")));
  EXPECT_THAT(told("odometry: {count: 2}\n---\nodometry: {count: 3}\n"),
              HasSubstr("a second document begins in line 2, and only one is read"));
  EXPECT_EQ(told("---\nodometry: {count: 2, speed_mps: 2}\nfusion: {count: 2, x: [a, a], y: {a: a}, z: {a: a}}\n...\n"),
            "no error");
}

TEST_F(ConfigTest, CommandLineTakesAnyTextAsItStands) {
  const auto name = [](const std::string& text) {
    const auto config = read_config<Config>("odometry", {}, {{"odometry.name", text}});
    return config.ok() ? config.value().name : error_of(config);
  };
  for (const char* text : {"/data/pics #2", "a: b", "- a", "&a", "*", "%", "a, b", "@"}) EXPECT_EQ(name(text), text);
  EXPECT_EQ(name("\"a #2\""), "a #2");
  EXPECT_EQ(name("'[a]'"), "[a]");
}

TEST_F(ConfigTest, NamesOfTrainAndHostMustFitIntoThoseOfFiles) {
  CommonConfig common;
  EXPECT_TRUE(common.check().ok());
  common.train_id = "a/b";
  EXPECT_THAT(common.check().error().message, HasSubstr("common.train_id 'a/b' is no name of at most 64 letters"));
  common.train_id = "re460-042";
  common.host = "";
  EXPECT_THAT(common.check().error().message, HasSubstr("common.host '' is no name"));
}

}  // namespace
}  // namespace railfix::service
