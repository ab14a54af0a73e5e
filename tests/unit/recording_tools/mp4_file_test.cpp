#include "recording/mp4_file.hpp"

#include <gmock/gmock.h>

#include "unit/dataset/temporary_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::HasSubstr;
using namespace std::string_literals;

class Mp4File : public railfix::testing::TemporaryFolder {
 protected:
  [[nodiscard]] bool whole(const std::string& content) const {
    return whole_mp4(write("film.mp4", content), "the film").ok();
  }
};

TEST_F(Mp4File, IsWholeWithItsIndexAndToTheByte) {
  const auto type =
      "\0\0\0\x0c"
      "ftypisom"s;
  const auto pictures =
      "\0\0\0\x01mdat\0\0\0\0\0\0\0\x13"
      "abc"s;
  const auto index = "\0\0\0\x0amoov12"s;
  EXPECT_TRUE(whole(type + pictures + index));
  EXPECT_FALSE(whole(type + pictures)) << "no index";
  EXPECT_FALSE(whole(type + pictures + index.substr(0, 9))) << "half an index";
  EXPECT_FALSE(whole(type + "\0\0\0\0mdatabc"s + index)) << "FFmpeg did not come to say how long the pictures are";
  EXPECT_FALSE(whole(""));
}

TEST_F(Mp4File, ThatIsCutSaysWhy) {
  EXPECT_THAT(whole_mp4("/dev/full", "the film").error().message,
              HasSubstr("cannot write the film to its end (No space left on device); make space there"));
}

}  // namespace
}  // namespace railfix::tool
