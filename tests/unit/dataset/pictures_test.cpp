#include <gmock/gmock.h>

#include <opencv2/videoio.hpp>

#include "dataset/dataset.hpp"
#include "support/film_file.hpp"
#include "temporary_folder.hpp"

namespace railfix::dataset {
namespace {

using ::testing::AllOf;
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

class FilmTest : public PicturesTest {
 protected:
  static void SetUpTestSuite() { setenv("GST_PLUGIN_FEATURE_RANK", "avdec_h264:NONE", 1); }  // the image has no FFmpeg

  /// Milliseconds at the rate that the film claims, 25 /s or another.
  [[nodiscard]] std::string film(const std::string& encoder, const std::vector<int64_t>& times_ms,
                                 const std::string& rate = "25/1") const {
    std::vector<int64_t> times_ns;
    times_ns.reserve(times_ms.size());
    for (const int64_t time_ms : times_ms) times_ns.push_back(time_ms * 1'000'000);
    railfix::testing::write_film(root_ / "film", encoder, rate, times_ns);
    return root_ / "film";
  }
  /// "number:stamp in microseconds" of every picture, or the error.
  static std::vector<std::string> times(const std::string& file, const PictureOptions& options = {}) {
    auto opened = open_pictures(file, options);
    if (!opened.ok()) return {opened.error().message};
    std::vector<std::string> seen;
    while (true) {
      const auto before_ns = opened.value()->next_stamp_ns();
      const auto next = opened.value()->next();
      if (!next.ok()) {
        seen.push_back(next.error().message);
        continue;
      }
      if (!next.value()) return seen;
      EXPECT_EQ(before_ns, next.value()->stamp_ns);
      seen.push_back(next.value()->name + ":" + std::to_string(next.value()->stamp_ns / 1000));
    }
  }
};

TEST_F(FilmTest, VaryingRateAndLostFramesKeepTheFilmsTimes) {
  for (const char* container : {"mp4mux", "matroskamux", "mpegtsmux"}) {
    const auto file = film(std::string("openh264enc ! h264parse ! ") + container, {0, 40, 80, 200, 240, 510});
    EXPECT_THAT(times(file), ElementsAre("0:0", "1:40000", "2:80000", "3:200000", "4:240000", "5:510000")) << container;
  }
  EXPECT_THAT(times(root_ / "film", {10.0}),
              ElementsAre("0:0", "1:100000", "2:200000", "3:300000", "4:400000", "5:500000"))
      << "a rate that is given goes before the film's";
}

TEST_F(FilmTest, RoundedTimesAreThoseOfTheRate) {
  const auto file = film("jpegenc ! matroskamux", {0, 33, 67, 200, 233}, "30/1");
  EXPECT_THAT(times(file), ElementsAre("0:0", "1:33333", "2:66666", "3:200000", "4:233333"));
}

TEST_F(FilmTest, FirstPictureIsTheBeginning) {
  EXPECT_THAT(times(film("jpegenc ! matroskamux", {80, 120, 200})), ElementsAre("0:0", "1:40000", "2:120000"));
}

TEST_F(FilmTest, FrameThatIsNotBehindTheOneBeforeIsBroken) {
  const auto file = film("jpegenc ! matroskamux", {0, 40, 80, 80, 120});
  EXPECT_THAT(times(file), ElementsAre("0:0", "1:40000", "2:80000",
                                       file + " frame 3 is at 0.080 s in the film, not behind the frame before it at "
                                              "0.080 s; it is left out",
                                       "4:120000"));
}

TEST_F(FilmTest, WithoutTimesAndRateItMustBeGiven) {
  const auto file = film("openh264enc ! h264parse ! video/x-h264,stream-format=byte-stream", {0, 40, 80});
  EXPECT_THAT(times(file), ElementsAre(AllOf(HasSubstr(file), HasSubstr("give the rate (fps)"))));
  EXPECT_THAT(times(file, {20.0}), ElementsAre("0:0", "1:50000", "2:100000"));
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
