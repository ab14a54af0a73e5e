#include "cdr/types.hpp"

#include <gmock/gmock.h>

namespace railfix::cdr {

namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(IdlTypes, ReadsEveryKindOfMember) {
  Types types;
  const auto status = types.add(R"(
    // A comment
    module a { module b {
      const unsigned long SIZE = 0x10;  /* sixteen */
      const short BELOW = -3;
      enum Colour { RED, GREEN };
      typedef float Row[3];
      @final @nested(TRUE) struct Inner { octet x, y[2]; };
      struct Outer {
        @key string<32> name;     // who
        sequence<Inner, SIZE> inner;
        Row rows[2];
        Colour colour;
        unsigned long long big;
        octet mode;               // COLOUR_*
        unsigned long flags;      // FLAG_* bits
        b::Inner one;
      };
    }; };
  )");
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_EQ(types.constants().at("a::b::SIZE"), 16);
  EXPECT_EQ(types.constants().at("a::b::BELOW"), -3);
  EXPECT_EQ(types.constants().at("a::b::GREEN"), 1);
  const Structure* outer = types.find("a::b::Outer");
  ASSERT_NE(outer, nullptr);
  ASSERT_EQ(outer->members.size(), 8U);
  const auto& members = outer->members;
  EXPECT_TRUE(members[0].key);
  EXPECT_EQ(members[0].comment, "who");
  EXPECT_EQ(members[0].type.bound, 32U);
  EXPECT_EQ(members[1].type.bound, 16U);
  EXPECT_EQ(members[1].type.element->structure, types.find("a::b::Inner"));
  EXPECT_THAT(members[2].type.dimensions, ElementsAre(2, 3));
  EXPECT_EQ(members[3].type.kind, Kind::int32);
  EXPECT_EQ(members[4].type.kind, Kind::uint64);
  EXPECT_EQ(members[5].constants, "COLOUR_");
  EXPECT_FALSE(members[5].bits);
  EXPECT_TRUE(members[6].bits);
  EXPECT_THAT(types.find("a::b::Inner")->members[1].type.dimensions, ElementsAre(2));
}

TEST(IdlTypes, MistakesNameTheLine) {
  const auto message = [](std::string_view text) {
    Types types;
    const auto status = types.add(text);
    return status.ok() ? std::string("no error") : status.error().message;
  };
  EXPECT_THAT(message("struct A {\n long x\n};"), HasSubstr("line 3: ';' expected"));
  EXPECT_THAT(message("struct A {\n wchar x;\n};"), HasSubstr("type 'wchar' is not defined or not supported"));
  EXPECT_THAT(message("struct A { long x[N]; };"), HasSubstr("constant 'N' is not defined"));
  EXPECT_THAT(message("struct A { long x[0]; };"), HasSubstr("a size of 0"));
  EXPECT_THAT(message("struct A { };"), HasSubstr("no members"));
  EXPECT_THAT(message("module m { struct A { long x; };"), HasSubstr("a name expected"));
  EXPECT_THAT(message("union U switch (long) { };"), HasSubstr("'union' is not understood"));
  EXPECT_THAT(message("@id("), HasSubstr("does not end"));
}

TEST(IdlTypes, EveryPrefixOfOurIdlIsReadOrRefused) {
  const std::string text(own_idl_of("railfix::msg::ServiceStatus"));
  ASSERT_FALSE(text.empty());
  for (size_t size = 0; size < text.size(); ++size) {
    Types types;
    (void)types.add(std::string_view(text).substr(0, size));
  }
}

TEST(IdlTypes, KnowsOurOwnTypes) {
  const Structure* view = own_types().find("railfix::msg::TrackView");
  ASSERT_NE(view, nullptr);
  EXPECT_EQ(view->members.front().name, "stamp_ns");
  EXPECT_EQ(own_types().constants().at("railfix::msg::ODOMETRY_BLIND"), 3);
  EXPECT_TRUE(own_idl_of("railfix::msg::NoSuchType").empty());
}

std::string refusal(const std::string& text) {
  Types types;
  const auto status = types.add(text);
  return status.ok() ? "no error" : status.error().message;
}

std::string repeated(size_t count, const std::string& text) {
  std::string all;
  for (size_t i = 0; i < count; ++i) all += text;
  return all;
}

TEST(IdlTypes, WhatNestsWithoutEndIsRefused) {
  for (const size_t count : {33U, 200'000U}) {
    EXPECT_THAT(refusal("struct A { " + repeated(count, "sequence<") + "octet" + repeated(count, ">") + " x; };"),
                HasSubstr("line 1: more than 32 sequences"));
    EXPECT_THAT(refusal(repeated(count, "module m { ") + "const long X = 1;" + repeated(count, "};")),
                HasSubstr("line 1: more than 32 modules"));
    EXPECT_THAT(refusal("struct A { octet x" + repeated(count, "[1]") + "; };"), HasSubstr("more than 32 dimensions"));
    std::string aliases = "typedef octet T0;\n";
    std::string arrays = aliases;
    for (size_t i = 1; i <= count; ++i) {
      const std::string before = "T" + std::to_string(i - 1);
      const std::string name = " T" + std::to_string(i);
      aliases += "typedef sequence<" + before + ">" + name + ";\n";
      arrays += "typedef " + before + name + "[1];\n";
    }
    EXPECT_THAT(refusal(aliases), HasSubstr("line 34: more than 32 sequences"));
    EXPECT_THAT(refusal(arrays), HasSubstr("line 34: more than 32 dimensions"));
  }
  EXPECT_EQ(refusal("struct A { " + repeated(32, "sequence<") + "octet" + repeated(32, ">") + " x; };"), "no error");
  EXPECT_EQ(refusal(repeated(50, "module m { const long X = 1; }; ")), "no error") << "beside each other";
}

TEST(IdlTypes, AnArrayOfAnArrayKeepsBothWhereverItIsNamed) {
  Types types;
  ASSERT_TRUE(types.add("typedef double V[3]; typedef V Pos; typedef V Box[2]; struct P { Pos p; Box b[4]; };").ok());
  const auto& members = types.find("P")->members;
  EXPECT_THAT(members[0].type.dimensions, ElementsAre(3));
  EXPECT_THAT(members[1].type.dimensions, ElementsAre(4, 2, 3));
}

TEST(IdlTypes, AnnotationsThatChangeTheBytesAreRefused) {
  EXPECT_THAT(refusal("struct A { long x;\n @optional long y; };"), HasSubstr("line 2: @optional is not supported"));
  EXPECT_THAT(refusal("@bit_bound(8) enum E { A };"), HasSubstr("@bit_bound is not supported"));
}

}  // namespace

}  // namespace railfix::cdr
