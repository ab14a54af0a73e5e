#include "recording/copy.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <limits>

#include "mcap/check.hpp"
#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "recording/repair.hpp"
#include "recording/standing_values.hpp"
#include "support/other_writers_file.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kSecond = 1'000'000'000;

/// What stands in a recording: "topic@seconds", in the order of reading.
std::vector<std::string> content(const fs::path& file) {
  auto reader = mcap::Reader::open(file).value();
  EXPECT_TRUE(mcap::check(file).value().problems.empty()) << file;
  std::vector<std::string> all;
  reader->for_each({}, [&](const mcap::Channel& channel, const mcap::Message& message) {
    all.push_back(channel.topic + "@" + std::to_string(message.log_time_ns / kSecond));
    return true;
  });
  return all;
}

class Copy : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// A recording of these samples, of which each has the second as its time.
  class Recorded {
   public:
    Recorded(const fs::path& file, const std::string& train) : writer_(mcap::Writer::create(file, {}).value()) {
      EXPECT_TRUE(writer_->write_metadata({"railfix", {{"train_id", train}}}).ok());
    }
    ~Recorded() { EXPECT_TRUE(writer_->close().ok()); }
    Recorded& calibration(const char* camera, double focal_px, int64_t at_s) {
      msg::CameraCalibration sample;
      sample.camera(camera);
      sample.fu_px(focal_px);
      return add(topics::camera_calibration, sample, at_s);
    }
    Recorded& step(int64_t at_s) {
      msg::OdometryStep sample;
      sample.stamp_ns(at_s);
      return add(topics::odometry_step, sample, at_s);
    }
    Recorded& status(const std::string& service, uint8_t state, int64_t at_s) {
      msg::ServiceStatus status;
      status.service(service);
      status.state(state);
      return add(messaging::topics::service_status, status, at_s);
    }
    Recorded& losses(const std::string& count) {
      EXPECT_TRUE(writer_->write_metadata({"railfix_losses", {{"imu_sample queue", count}}}).ok());
      return *this;
    }

   private:
    template <class T>
    Recorded& add(const messaging::Topic<T>& topic, const T& sample, int64_t at_s) {
      const auto schema = writer_->add_schema(messaging::type_of<T>().name(), "omgidl", "").value();
      const auto id = writer_->add_channel(schema, topic.name, "cdr", {}).value();
      const auto cdr = messaging::serialize(sample);
      EXPECT_TRUE(writer_->write({id, 1, at_s * kSecond, at_s * kSecond - 5, cdr}).ok());
      return *this;
    }
    std::unique_ptr<mcap::Writer> writer_;
  };

  fs::path folder_ = fs::temp_directory_path() / ("railfix-copy-" + std::to_string(::getpid()));
  fs::path a_ = folder_ / "a.mcap";
  fs::path b_ = folder_ / "b.mcap";
  fs::path out_ = folder_ / "out.mcap";
};

TEST_F(Copy, StandingValuesAreTheLastOfEachInstance) {
  Recorded(a_, "t")
      .calibration("cam0", 1, 1)
      .calibration("cam1", 2, 2)
      .calibration("cam0", 3, 3)
      .calibration("cam0", 4, 9);
  auto reader = mcap::Reader::open(a_).value();
  std::vector<double> focal_px;
  for (const auto& value : standing_values(*reader, {}, 9 * kSecond)) {
    msg::CameraCalibration calibration;
    ASSERT_TRUE(messaging::deserialize(value.cdr, calibration));
    focal_px.push_back(calibration.fu_px());
  }
  EXPECT_THAT(focal_px, ElementsAre(2, 3));
  EXPECT_TRUE(standing_values(*reader, {"odometry_step"}, 9 * kSecond).empty());
}

TEST_F(Copy, OfAServiceThatSaysNothingAnyMoreNothingStands) {
  Recorded(a_, "t").status("fusion", 1, 1).status("odometry", 2, 30).status("odometry", 3, 31).status("fusion", 1, 50);
  auto reader = mcap::Reader::open(a_).value();
  const auto values = standing_values(*reader, {}, 40 * kSecond);
  ASSERT_EQ(values.size(), 1U);
  msg::ServiceStatus status;
  ASSERT_TRUE(messaging::deserialize(values[0].cdr, status));
  EXPECT_EQ(status.state(), 3) << "its last word";
}

TEST_F(Copy, ACutKeepsWhatHeldAtItsBeginning) {
  Recorded(a_, "t").calibration("cam0", 1, 10).step(10).step(11).step(12).step(13).step(14);
  const auto report = cut_recording(a_, out_, {1.5, 3.5, {}, {}});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report.value().samples, 2U);
  EXPECT_EQ(report.value().standing, 1U);
  EXPECT_THAT(content(out_), ElementsAre("camera_calibration@11", "odometry_step@12", "odometry_step@13"));
  EXPECT_THAT(mcap::Reader::open(out_).value()->metadata(),
              ::testing::Contains(::testing::Field(&mcap::Metadata::name, "railfix_cut")));
}

TEST_F(Copy, ACutHasOnlyTheTopicsOneWants) {
  Recorded(a_, "t").calibration("cam0", 1, 10).step(10).step(11);
  constexpr double kAll = std::numeric_limits<double>::infinity();
  ASSERT_TRUE(cut_recording(a_, out_, {0, kAll, {"odometry_step"}, {}}).ok());
  EXPECT_THAT(content(out_), ElementsAre("odometry_step@10", "odometry_step@11"));
  const auto none = cut_recording(a_, folder_ / "none.mcap", {0, kAll, {"imu_sample"}, {}});
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().message, HasSubstr("has no topic imu_sample; there are: camera_calibration, odometry_step"));
  const auto behind = cut_recording(a_, folder_ / "none.mcap", {5, 9, {}, {}});
  ASSERT_FALSE(behind.ok());
  EXPECT_THAT(behind.error().message,
              HasSubstr("there is nothing from 5 s to 9 s: " + a_.string() + " is 1.00 s long"));
  const auto open_end = cut_recording(a_, folder_ / "none.mcap", {5, kAll, {}, {}});
  ASSERT_FALSE(open_end.ok());
  EXPECT_THAT(open_end.error().message, HasSubstr("there is nothing from 5 s to the end"));
  const auto turned_round = cut_recording(a_, folder_ / "none.mcap", {1, 0.5, {}, {}});
  ASSERT_FALSE(turned_round.ok());
  EXPECT_EQ(turned_round.error().message, "--to 0.5 must lie behind --from 1");
  EXPECT_FALSE(fs::exists(folder_ / "none.mcap"));
}

TEST_F(Copy, PartsAreMergedToTheWhole) {
  Recorded(a_, "t").calibration("cam0", 1, 10).step(10).step(11).step(12).step(13);
  ASSERT_TRUE(cut_recording(a_, folder_ / "1.mcap", {0, 2, {}, {}}).ok());
  ASSERT_TRUE(cut_recording(a_, folder_ / "2.mcap", {1, 9, {}, {}}).ok());
  const auto report = merge_recordings({folder_ / "2.mcap", folder_ / "1.mcap"}, out_);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report.value().samples, 5U);
  EXPECT_EQ(report.value().duplicates, 2U)
      << "the step of 11 s, and the calibration that is repeated in the second part";
  EXPECT_EQ(content(out_), content(a_));
}

TEST_F(Copy, LossesAddUp) {
  Recorded(a_, "t").step(1).losses("1").losses("3");
  Recorded(b_, "t").step(2).losses("4");
  ASSERT_TRUE(merge_recordings({a_, b_}, out_).ok());
  const auto reader = mcap::Reader::open(out_).value();
  EXPECT_THAT(reader->metadata(), ::testing::Contains(mcap::Metadata{"railfix_losses", {{"imu_sample queue", "7"}}}));
}

TEST_F(Copy, PartsOfOneRecordingLostTheSame) {
  {
    auto writer = mcap::Writer::create(a_, {}).value();
    ASSERT_TRUE(writer->write_metadata({"railfix", {{"train_id", "t"}, {"started_ns", "17"}}}).ok());
    ASSERT_TRUE(writer->write_metadata({"railfix_losses", {{"imu_sample queue", "3"}}}).ok());
    const auto id = writer->add_channel(0, "odometry_step", "cdr", {}).value();
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(writer->write({id, 1, i * kSecond, i * kSecond, mcap::Bytes(9, 7)}).ok());
    ASSERT_TRUE(writer->close().ok());
  }
  ASSERT_TRUE(cut_recording(a_, folder_ / "1.mcap", {0, 2, {}, {}}).ok());
  ASSERT_TRUE(cut_recording(a_, folder_ / "2.mcap", {2, 9, {}, {}}).ok());
  ASSERT_TRUE(merge_recordings({folder_ / "1.mcap", folder_ / "2.mcap"}, out_).ok());
  const auto reader = mcap::Reader::open(out_).value();
  EXPECT_THAT(reader->metadata(), ::testing::Contains(mcap::Metadata{"railfix_losses", {{"imu_sample queue", "3"}}}));
}

TEST_F(Copy, WhatOneRecordingHasTwiceStays) {
  const auto record = [&](const fs::path& file, int64_t at_s) {
    auto writer = mcap::Writer::create(file, {}).value();
    const auto id = writer->add_channel(0, "odometry_step", "cdr", {}).value();
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer->write({id, 0, (at_s + i) * kSecond, 0, mcap::Bytes(9, 7)}).ok());
    ASSERT_TRUE(writer->close().ok());
  };
  record(a_, 1);
  record(b_, 5);
  const auto merged = merge_recordings({a_, b_}, out_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged.value().samples, 3U);
  EXPECT_EQ(merged.value().duplicates, 3U);
}

TEST_F(Copy, ATopicThatIsNotThereIsNamed) {
  Recorded(a_, "t").step(1);
  for (const CutOptions& options :
       {CutOptions{0, 9, {"odometry_step", "odometry_stp"}, {}}, CutOptions{0, 9, {}, {"odometry_stp"}}}) {
    const auto refused = cut_recording(a_, out_, options);
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message, HasSubstr("has no topic odometry_stp; did you mean odometry_step?"));
  }
}

TEST_F(Copy, ATopicOfRailfixNeedNotBeThereToBeLeftOut) {
  Recorded(a_, "t").step(1);
  EXPECT_TRUE(cut_recording(a_, out_, {0, 9, {}, {"camera_frame"}}).ok());
}

TEST_F(Copy, WhatAKilledOneLeftIsNamedAndStays) {
  Recorded(a_, "t").step(1);
  Recorded(b_, "t").step(2);
  const fs::path left = out_.string() + ".active";
  fs::copy_file(a_, left);
  constexpr double kAll = std::numeric_limits<double>::infinity();
  for (const auto& error : {cut_recording(a_, out_, {0, kAll, {}, {}}).error(),
                            merge_recordings({a_, b_}, out_).error(), repair_recording(a_, out_).error()}) {
    EXPECT_THAT(error.message, HasSubstr(left.string() +
                                         " was left by a recorder, cut, merge or repair that was killed; "
                                         "remove it, or save what is in it with `railfix recording repair " +
                                         left.string() + "` before"));
  }
  EXPECT_EQ(fs::file_size(left), fs::file_size(a_));
  EXPECT_FALSE(fs::exists(out_));
  ASSERT_TRUE(repair_recording(left, folder_ / "saved.mcap").ok());
  EXPECT_THAT(content(folder_ / "saved.mcap"), ElementsAre("odometry_step@1"));
}

TEST_F(Copy, OfNothingThatCanBeReadNothingIsMade) {
  Recorded(a_, "t").step(1);
  fs::resize_file(a_, 8);  // the file's first mark
  const auto refused = repair_recording(a_, out_);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("holds no sample that can be read; nothing is written"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
}

TEST_F(Copy, WhatIsBeingWrittenIsLeftToItsWriter) {
  Recorded(a_, "t").step(1);
  const auto writer = mcap::Writer::create(out_, {}).value();
  const auto refused = cut_recording(a_, out_, {0, 1, {}, {}});
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr(out_.string() + ".active is being written by another process"));
  EXPECT_TRUE(writer->close().ok());
  EXPECT_TRUE(fs::exists(out_));
}

std::map<std::string, std::string> trace_in(const fs::path& file) {
  const auto reader = mcap::Reader::open(file).value();
  for (const auto& metadata : reader->metadata()) {
    if (metadata.name == "railfix_repair") return metadata.entries;
  }
  return {};
}

TEST_F(Copy, ARepairedOneSaysWhatIsMissing) {
  // One chunk for each step.
  mcap::WriterOptions options;
  options.chunk_bytes = 1;
  auto writer = mcap::Writer::create(a_, options).value();
  const auto id = writer->add_channel(0, "odometry_step", "cdr", {}).value();
  std::vector<uint64_t> ends;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(writer->write({id, 1, i * kSecond, i * kSecond, mcap::Bytes(100, 7)}).ok());
    ends.push_back(writer->bytes_written());
  }
  ASSERT_TRUE(writer->close().ok());

  fs::copy_file(a_, b_);
  std::fstream(b_, std::ios::binary | std::ios::in | std::ios::out)
      .seekp(static_cast<std::streamoff>(ends[1]) + 30)
      .write("XXXXXXXX", 8);
  const auto repaired = repair_recording(b_, out_);
  ASSERT_TRUE(repaired.ok()) << repaired.error().message;
  EXPECT_EQ(repaired.value().lost.samples, 1U);
  EXPECT_THAT(content(out_), ElementsAre("odometry_step@0", "odometry_step@1", "odometry_step@3"));
  auto trace = trace_in(out_);
  EXPECT_EQ(trace["file"], "b.mcap");
  EXPECT_EQ(trace["lost_chunks"], "1");
  EXPECT_EQ(trace["lost_samples"], "1");
  EXPECT_EQ(trace["skipped_bytes"], std::to_string(repaired.value().lost.bytes));
  EXPECT_GT(repaired.value().lost.bytes, 50U);

  for (const bool cut : {true, false}) {
    Recorded(folder_ / "c.mcap", "").step(9);
    const auto copied = cut ? cut_recording(b_, folder_ / "d.mcap", {0, 9, {}, {}})
                            : merge_recordings({b_, folder_ / "c.mcap"}, folder_ / "e.mcap");
    ASSERT_TRUE(copied.ok()) << copied.error().message;
    EXPECT_EQ(copied.value().lost.chunks, 1U);
    trace = trace_in(folder_ / (cut ? "d.mcap" : "e.mcap"));
    EXPECT_EQ(trace["file"], "b.mcap");
    EXPECT_EQ(trace["lost_chunks"], "1");
    fs::remove(folder_ / "c.mcap");
  }

  fs::resize_file(b_, ends[2] + 20);
  ASSERT_TRUE(repair_recording(b_, folder_ / "cut.mcap").ok());
  trace = trace_in(folder_ / "cut.mcap");
  EXPECT_EQ(trace["lost_chunks"], "1");
  EXPECT_FALSE(trace.contains("lost_samples")) << "the index is gone";
  EXPECT_EQ(std::stoull(trace["skipped_bytes"]), repaired.value().lost.bytes + 20);
}

TEST_F(Copy, OneRecordingIsOneTrains) {
  Recorded(a_, "one").step(1);
  Recorded(b_, "other").step(2);
  const auto merged = merge_recordings({a_, b_}, out_);
  ASSERT_FALSE(merged.ok());
  EXPECT_THAT(merged.error().message, HasSubstr("is of train other"));
  const auto itself = merge_recordings({a_, a_}, a_);
  ASSERT_FALSE(itself.ok());
  EXPECT_THAT(itself.error().message, HasSubstr("is one of the recordings"));
}

TEST_F(Copy, NothingOfOtherWritersFilesIsLost) {
  for (unsigned bits = 0; bits < test::OtherSummary::kCombinations; ++bits) {
    const auto bytes = test::other_writers_file(test::OtherSummary(bits));
    std::ofstream(a_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    const auto made = [&](const std::string& name) { return folder_ / (std::to_string(bits) + name); };
    ASSERT_TRUE(merge_recordings({a_}, made("merged.mcap")).ok());
    ASSERT_TRUE(cut_recording(a_, made("cut.mcap"), {0, std::numeric_limits<double>::infinity(), {}, {}}).ok());
    const auto repaired = repair_recording(a_, made("repaired.mcap"));
    ASSERT_TRUE(repaired.ok()) << repaired.error().message;
    EXPECT_EQ(repaired.value().lost.samples, 0U) << bits;
    for (const char* name : {"merged.mcap", "cut.mcap", "repaired.mcap"}) {
      EXPECT_EQ(content(made(name)).size(), test::kOtherSamples) << bits << name;
    }
  }
}

}  // namespace
}  // namespace railfix::tool
