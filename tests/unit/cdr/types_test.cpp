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

}  // namespace

}  // namespace railfix::cdr
