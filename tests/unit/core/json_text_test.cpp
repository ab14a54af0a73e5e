#include "core/json_text.hpp"

#include <gtest/gtest.h>

namespace railfix::core {
namespace {

std::string refusal(const std::string& text) {
  const auto json = parse_json(text);
  return json.ok() ? "accepted" : json.error().message;
}

std::string nested(size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

TEST(JsonText, RefusesWhatNestsWithoutEnd) {
  EXPECT_EQ(refusal(nested(kDeepestJson)), "accepted");
  for (const size_t depth : {kDeepestJson + 1, size_t{150'000}})
    EXPECT_EQ(refusal(nested(depth)), "its lists and objects nest more than 64 deep.");
  EXPECT_EQ(refusal(R"({"T_TRAIN":)" + nested(kDeepestJson) + "}"), refusal(nested(kDeepestJson + 1)));
  EXPECT_EQ(refusal(std::string(150'000, '[')), refusal(nested(kDeepestJson + 1))) << "never closed";
}

TEST(JsonText, CountsDepthAsTheParserDoes) {
  EXPECT_EQ(json_depth(R"([{"a": [1]}, {}, []])"), 3U);
  EXPECT_EQ(json_depth(R"({"a [[ \" [[ \\": "{{", "b": []})"), 2U) << "brackets in strings";
  EXPECT_EQ(json_depth("]]]["), 1U);
  EXPECT_EQ(json_depth("\"\\"), 0U);
}

TEST(JsonText, SaysWhereItBreaks) {
  EXPECT_EQ(refusal(""), "not JSON at byte 1.");
  EXPECT_EQ(refusal("{\"a\" 1}"), "not JSON at byte 6.");
  EXPECT_EQ(refusal("{\n  \"a\": 1,\n  \"b\": x\n}\n"), "not JSON at line 3, column 8.");
  EXPECT_EQ(refusal("x\n"), "not JSON at line 1, column 1.");
  EXPECT_EQ(refusal("[\n"), "not JSON at line 2, column 1.");
  EXPECT_EQ(refusal("[1e999]"), "a number in it is too large.");
}

TEST(JsonText, NamesAKeyThatIsThereTwice) {
  EXPECT_EQ(repeated_key(R"({"a": 1, "b": {"a": 2}, "c": [{"a": 3}, {"a": 4}]})"), std::nullopt);
  EXPECT_EQ(repeated_key(R"([{"a": "b"}, {"b": {"x": {}, "y": 1, "x": 2}}])"), "x");
  EXPECT_EQ(repeated_key(R"({"\u0061": 1, "a": 1})"), "a") << "as the parser reads it";
  EXPECT_TRUE(parse_json(R"({"a": 1, "a": 2})").ok()) << "what devices and networks say is taken as it is";
  EXPECT_EQ(parse_json_strictly(R"({"a": 1, "a": 2})").error().message, "the key \"a\" is there twice in one object.");
  EXPECT_EQ(parse_json_strictly(R"({"a": 1, "a": 2)").error().message, "not JSON at byte 16.");
  EXPECT_EQ(parse_json_strictly(R"({"a": 1})").value()["a"], 1);
}

}  // namespace
}  // namespace railfix::core
