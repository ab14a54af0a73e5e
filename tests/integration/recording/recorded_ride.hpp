// A made-up ride in a recording, and `railfix recording` as a user calls it.
#pragma once

#include <gmock/gmock.h>

#include <set>

#include "cdr/types.hpp"
#include "core/time.hpp"
#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "pictures/encode.hpp"
#include "support/program.hpp"

namespace railfix {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int64_t kBegin = 1'700'000'000 * core::kNsPerSecond;
constexpr int kPictures = 50;
constexpr int64_t kPictureNs = 40'000'000;

/// 20 m/s to the north for two seconds, with pictures.
class RecordedRide : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    writer_ = mcap::Writer::create(file(), {}).value();
    EXPECT_TRUE(writer_->write_metadata({"railfix", {{"train_id", "t7"}}}).ok());
    EXPECT_TRUE(writer_->write_metadata({"railfix_losses", {{"imu_sample queue", "12"}}}).ok());
    msg::CameraCalibration calibration;
    calibration.camera("cam0");
    calibration.fu_px(300);
    calibration.fv_px(300);
    calibration.cu_px(159.5);
    calibration.cv_px(119.5);
    calibration.width_px(320);
    calibration.height_px(240);
    write(topics::camera_calibration, calibration, "camera_calibration", 0);
    for (int i = 0; i < kPictures; ++i) ride(i);
    msg::LogRecord log;
    log.service("fusion");
    log.text("wheel, \"left\", slides");
    write(topics::log_record, log, "log_record", 1);
    const auto closed = writer_->close();
    ASSERT_TRUE(closed.ok());
  }
  void TearDown() override { fs::remove_all(folder_); }

  // 20 m/s to the north; the picture of 0.4 s is missing; no place before 0.2 s.
  void ride(int i) {
    const int64_t time_ns = i * kPictureNs;
    const std::vector<uint8_t> pixels(320 * 240, static_cast<uint8_t>(4 * i));
    msg::CameraPreview picture;
    picture.stamp_ns(kBegin + time_ns);
    picture.jpeg(pictures::encode_jpeg(pixels.data(), 320, 240, 90).value());
    if (i != 10) write(topics::camera_preview, picture, "camera_frame/cam0", time_ns);
    msg::TrackView view;
    view.stamp_ns(kBegin + time_ns);
    view.pitch_rad(0.2);
    view.height_m(2.5);
    view.seen_left(1);
    view.seen_right(1);
    write(topics::track_view, view, "track_view", time_ns);
    msg::TrainState state;
    state.stamp_ns(kBegin + time_ns);
    state.track_known(i >= 5 ? 1 : 0);
    state.edge(3);
    state.offset_m(100 + 0.8 * i);
    state.speed_mps(20);
    state.over_m(6);
    state.under_m(4);
    state.integrity(integrity_);
    state.sources(msg::SOURCE_CAMERA | msg::SOURCE_WHEEL);
    state.lat_deg(47 + 0.8 * i / 111195);
    state.lon_deg(8);
    write(topics::train_state, state, "train_state", time_ns);
  }
  template <class T>
  void write(const messaging::Topic<T>& /*topic*/, const T& sample, const std::string& name, int64_t time_ns) {
    const auto schema = writer_
                            ->add_schema(messaging::type_of<T>().name(), "omgidl",
                                         std::string(cdr::own_idl_of(messaging::type_of<T>().name())))
                            .value();
    const auto channel = writer_->add_channel(schema, name, "cdr", {}).value();
    const auto bytes = messaging::serialize(sample);
    EXPECT_TRUE(writer_->write({channel, 1, kBegin + time_ns, kBegin + time_ns, bytes}).ok());
  }
  [[nodiscard]] fs::path file() const { return folder_ / "ride.mcap"; }
  [[nodiscard]] test::Outcome recording(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"railfix", "recording"});
    return test::run_program(arguments, 120);
  }

  /// Where no file may grow beyond this: it fails in the middle, as on a full disk.
  [[nodiscard]] static test::Outcome recording_in(int most_kb, const std::string& arguments) {
    const std::string command = std::string(RAILFIX_BIN_DIR) + "/railfix recording " + arguments;
    return test::run_program(
        {"/bin/bash", "-c", "trap '' XFSZ; ulimit -f " + std::to_string(most_kb) + "; exec " + command}, 120);
  }
  [[nodiscard]] std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.insert(entry.path().filename());
    return names;
  }

  fs::path folder_ = fs::temp_directory_path() / ("railfix-export-" + std::to_string(::getpid()));
  std::unique_ptr<mcap::Writer> writer_;
  uint8_t integrity_ = msg::INTEGRITY_OK;
};

}  // namespace railfix
