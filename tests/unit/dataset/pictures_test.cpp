#include <gmock/gmock.h>

#include <opencv2/videoio.hpp>

#include "dataset/dataset.hpp"
#include "temporary_folder.hpp"

namespace railfix::dataset {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class PicturesTest : public railfix::testing::TemporaryFolder {
 protected:
  /// "stamp:grey" of every picture, or the error's file name.
  static std::vector<std::string> play(PictureSource& source) {
    std::vector<std::string> seen;
    while (true) {
      const auto next = source.next();
      if (!next.ok()) {
        seen.push_back("broken");
        continue;
      }
      if (!next.value()) return seen;
      const Picture& picture = *next.value();
      EXPECT_EQ(picture.grey.type(), CV_8UC1);
      seen.push_back(std::to_string(picture.stamp_ns) + ":" + std::to_string(picture.grey.at<uchar>(2, 3)));
    }
  }
  static std::vector<std::string> play(const std::filesystem::path& path, const PictureOptions& options = {}) {
    auto opened = open_pictures(path, options);
    if (!opened.ok()) return {opened.error().message};
    return play(*opened.value());
  }
};

TEST_F(PicturesTest, EurocFolderFromAnyOfItsLevels) {
  write("seq/mav0/cam0/data.csv", "#timestamp [ns],filename\r\n1000,b.png\r\n2000,a.jpg\r\n3000,c.pgm\r\n");
  write_picture("seq/mav0/cam0/data/b.png", 10, CV_8UC3);
  write_picture("seq/mav0/cam0/data/a.jpg", 20);
  write_picture("seq/mav0/cam0/data/c.pgm", 30);
  for (const char* level : {"seq", "seq/mav0", "seq/mav0/cam0", "seq/mav0/cam0/"}) {
    EXPECT_THAT(play(root_ / level), ElementsAre("1000:10", "2000:20", "3000:30")) << level;
  }
  auto source = core::value_or_throw(open_pictures(root_ / "seq", {}));
  EXPECT_EQ(source->count(), 3U);
  EXPECT_TRUE(source->skip());
  EXPECT_EQ(source->next_stamp_ns(), 2000);
  EXPECT_THAT(play(*source), ElementsAre("2000:20", "3000:30"));
  EXPECT_EQ(source->next_stamp_ns(), std::nullopt);
  EXPECT_FALSE(source->skip());
}

TEST_F(PicturesTest, BrokenAndMissingPicturesAreErrorsAndReadingGoesOn) {
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1,a.png\n2,broken.png\n3,missing.png\n4,d.png\n");
  write_picture("mav0/cam0/data/a.png", 1);
  write("mav0/cam0/data/broken.png", "this is no picture");
  write_picture("mav0/cam0/data/d.png", 4);
  EXPECT_THAT(play(root_), ElementsAre("1:1", "broken", "broken", "4:4"));
  auto source = core::value_or_throw(open_pictures(root_, {}));
  (void)source->next();
  EXPECT_THAT(source->next().error().message, HasSubstr("broken.png"));
  EXPECT_THAT(source->next().error().message, HasSubstr("missing.png"));
}

TEST_F(PicturesTest, BrokenListNamesFileAndLine) {
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1,a.png\nx,b.png\n");
  EXPECT_THAT(play(root_), ElementsAre(HasSubstr("data.csv line 3: 'x'")));
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1,a.png\n7\n");
  EXPECT_THAT(play(root_), ElementsAre(HasSubstr("data.csv line 3")));
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n");
  EXPECT_THAT(play(root_), ElementsAre(HasSubstr("lists no pictures")));
}

TEST_F(PicturesTest, PlainFolderInNameOrderAtTheGivenRate) {
  write_picture("p/0002.png", 2, CV_8UC3);
  write_picture("p/0001.png", 1);
  write_picture("p/0010.JPG", 10);
  write("p/notes.txt", "ignored");
  EXPECT_THAT(play(root_ / "p", {10.0}), ElementsAre("0:1", "100000000:2", "200000000:10"));
  EXPECT_THAT(play(root_ / "p/0010.JPG"), ElementsAre("0:10"));
}

TEST_F(PicturesTest, KittiFolder) {
  write_picture("k/image_0/000000.png", 5);
  write_picture("k/image_0/000001.png", 6);
  write("k/times.txt", "0.000000e+00\n1.037875e-01\n");
  EXPECT_THAT(play(root_ / "k"), ElementsAre("0:5", "103787500:6"));
  write("k/times.txt", "0.0\n");
  EXPECT_THAT(play(root_ / "k"), ElementsAre(HasSubstr("1 times for 2 pictures")));
  write("k/times.txt", "0.0\nsoon\n");
  EXPECT_THAT(play(root_ / "k"), ElementsAre(HasSubstr("times.txt line 2: 'soon'")));
}

TEST_F(PicturesTest, VideoAtItsOwnRateOrTheGivenOne) {
  const std::string file = (root_ / "v.avi").string();
  cv::VideoWriter writer(file, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0, cv::Size(64, 48));
  ASSERT_TRUE(writer.isOpened());
  for (const int grey : {40, 80, 120}) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(grey)));
  writer.release();
  auto source = core::value_or_throw(open_pictures(file, {}));
  std::vector<int64_t> stamps;
  for (auto next = source->next(); next.ok() && next.value(); next = source->next()) {
    EXPECT_NEAR(next.value()->grey.at<uchar>(2, 3), 40.0 * static_cast<double>(stamps.size() + 1), 3.0);
    stamps.push_back(next.value()->stamp_ns);
  }
  EXPECT_THAT(stamps, ElementsAre(0, 40'000'000, 80'000'000));
  auto skipping = core::value_or_throw(open_pictures(file, {}));
  EXPECT_TRUE(skipping->skip());
  EXPECT_EQ(skipping->next_stamp_ns(), 40'000'000);
  EXPECT_NEAR(skipping->next().value()->grey.at<uchar>(2, 3), 80, 3);
  EXPECT_TRUE(skipping->skip());
  EXPECT_FALSE(skipping->skip());
  auto faster = core::value_or_throw(open_pictures(file, {50.0}));
  (void)faster->next();
  EXPECT_EQ(faster->next().value()->stamp_ns, 20'000'000);
}

TEST_F(PicturesTest, WhatCannotBeOpenedIsASentence) {
  EXPECT_THAT(play(root_ / "nothing"), ElementsAre(HasSubstr("does not exist")));
  EXPECT_THAT(play(root_), ElementsAre(HasSubstr("holds no pictures")));
  EXPECT_THAT(play(write("a.mp4", "no video")), ElementsAre(HasSubstr("neither a picture nor a video")));
  write("s/mav0/imu0/data.csv", "");
  EXPECT_THAT(play(root_ / "s"), ElementsAre(HasSubstr("has no pictures")));
}

}  // namespace
}  // namespace railfix::dataset
