#include "core/cut_text.hpp"

#include <gtest/gtest.h>

namespace railfix::core {
namespace {

TEST(CutText, WhatFitsStays) {
  EXPECT_EQ(cut_text("", 0), "");
  EXPECT_EQ(cut_text("Graz", 4), "Graz");
}

TEST(CutText, IsCutBetweenTwoCharacters) {
  const std::string town = "St. P\u00f6lten";
  EXPECT_EQ(cut_text(town, 5), "St. P");
  EXPECT_EQ(cut_text(town, 6), "St. P") << "one byte of the two of an umlaut";
  EXPECT_EQ(cut_text(town, 7), "St. P\u00f6");
  EXPECT_EQ(cut_text("\u20ac", 2), "");
}

TEST(CutText, WhatIsNoUtf8AtAllIsCutAsWell) {
  EXPECT_EQ(cut_text(std::string(5, '\x80'), 3), "");
  EXPECT_EQ(cut_text("\xff\xff\xff", 2), "\xff\xff");
}

}  // namespace
}  // namespace railfix::core
