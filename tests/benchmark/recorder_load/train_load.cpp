#include "train_load.hpp"

#include <algorithm>
#include <functional>
#include <thread>

#include "core/random.hpp"
#include "core/time.hpp"

namespace railfix {

namespace {

namespace topics = messaging::topics;

constexpr size_t kPictures = 8;

/// Grey of ballast and rails, with the grain of a real sensor: what makes pictures hard to pack.
std::vector<uint8_t> picture(uint32_t width_px, uint32_t height_px, core::Random& random) {
  std::vector<uint8_t> pixels(static_cast<size_t>(width_px) * height_px);
  double grain = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto u = static_cast<double>(i % width_px);
    const auto v = static_cast<double>(i) / width_px;
    grain = 0.7 * grain + 8 * random.normal();
    const double rail = std::abs(u - 400) < 20 || std::abs(u - 880) < 20 ? 60 : 0;
    pixels[i] = static_cast<uint8_t>(std::clamp(70 + 60 * v / height_px + rail + grain, 0.0, 255.0));
  }
  return pixels;
}

}  // namespace

struct TrainLoad::Stream {
  std::string name;
  int64_t period_ns;
  std::function<bool(uint64_t seq)> write;
  std::function<int()> readers;
  int64_t due_ns = 0;
  uint64_t seq = 0;
};

template <class T>
void TrainLoad::add(const messaging::Topic<T>& topic, double rate_hz) {
  auto writer = std::make_shared<messaging::Writer<T>>(participant_, topic);
  auto sample = std::make_shared<T>();
  // Numbers that change as measured ones do, as far as the packing notices.
  auto random = std::make_shared<core::Random>(static_cast<uint64_t>(rate_hz));
  const auto write = [writer, sample, random](uint64_t seq) {
    sample->stamp_ns(core::wall_ns());
    if constexpr (requires { sample->seq(seq); }) sample->seq(seq);
    if constexpr (requires { sample->left_u_px(); }) {
      for (auto& value : sample->left_u_px()) value = static_cast<float>(random->uniform(0, 1280));
    }
    if constexpr (requires { sample->offset_m(0.0); }) sample->offset_m(random->uniform(0, 1000));
    return writer->write(*sample);
  };
  streams_.push_back(std::make_unique<Stream>(
      Stream{topic.name, core::to_ns(1 / rate_hz), write, [writer] { return writer->matched_readers(); }, 0, 0}));
}

void TrainLoad::add_camera() {
  core::Random random(1);
  for (size_t i = 0; i < kPictures; ++i) {
    pictures_.push_back(picture(options_.width_px, options_.height_px, random));
  }
  auto writer = std::make_shared<messaging::Writer<msg::CameraFrame>>(participant_, topics::camera_frame, "cam0");
  const auto write = [this, writer](uint64_t seq) {
    return writer->write_in_place([&](msg::CameraFrame& frame) {
      frame.stamp_ns(core::wall_ns());
      frame.grabbed_ns(core::wall_ns());
      frame.seq(seq);
      frame.width_px(options_.width_px);
      frame.height_px(options_.height_px);
      frame.exposure_s(0.001F);
      frame.health(0);
      std::ranges::copy(pictures_[seq % kPictures], frame.data().begin());
    });
  };
  streams_.push_back(std::make_unique<Stream>(Stream{"camera_frame/cam0", core::to_ns(1 / options_.rate_hz), write,
                                                     [writer] { return writer->matched_readers(); }, 0, 0}));
}

TrainLoad::TrainLoad(messaging::Participant& participant, const LoadOptions& options)
    : participant_(participant), options_(options) {
  add_camera();
  add(topics::imu_sample, 200);
  add(topics::wheel_sample, 50);
  add(topics::gnss_fix, 10);
  for (const double rate_hz : {options_.rate_hz}) {
    add(topics::track_view, rate_hz);
    add(topics::odometry_step, rate_hz);
    add(topics::train_state, rate_hz);
    add(topics::train_pose, rate_hz);
  }
  add(topics::landmark_sighting, 10);
  add(topics::position_fix, 10);
  add(topics::log_record, 5);
}

TrainLoad::~TrainLoad() = default;

bool TrainLoad::heard() const {
  return std::ranges::all_of(streams_, [](const auto& stream) { return stream->readers() > 0; });
}

void TrainLoad::send(double seconds) {
  const int64_t begin_ns = core::monotonic_ns();
  for (auto& stream : streams_) stream->due_ns = begin_ns;
  while (true) {
    auto& next = **std::ranges::min_element(streams_, {}, [](const auto& stream) { return stream->due_ns; });
    if (next.due_ns >= begin_ns + core::to_ns(seconds)) return;
    const int64_t ahead_ns = next.due_ns - core::monotonic_ns();
    if (ahead_ns > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(ahead_ns));
    if (next.name == "camera_frame/cam0" && -ahead_ns > next.period_ns) ++late_;
    if (next.write(++next.seq)) ++sent_[next.name];
    next.due_ns += next.period_ns;
  }
}

}  // namespace railfix
