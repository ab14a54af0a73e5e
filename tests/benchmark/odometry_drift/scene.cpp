#include "scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "core/random.hpp"
#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/traffic.hpp"

namespace railfix {
namespace {

constexpr simulator::Strip kDrawn{60.0, 1.0};

class Dataset : public Scene {
 public:
  explicit Dataset(const std::string& folder)
      : calibration_(core::value_or_throw(dataset::read_calibration(folder + "/mav0/cam0/sensor.yaml"))),
        pictures_(core::value_or_throw(dataset::open_pictures(folder, {}))) {
    for (const auto& row : core::value_or_throw(dataset::read_truth(folder + "/truth/track.csv")))
      truth_[row.stamp_ns] = row;
  }
  std::optional<Moment> next() override {
    while (true) {
      const auto picture = core::value_or_throw(pictures_->next());
      if (!picture) return std::nullopt;
      const auto row = truth_.find(picture->stamp_ns);
      if (row != truth_.end()) return Moment{picture->grey, picture->stamp_ns, 0, row->second};
    }
  }
  [[nodiscard]] const dataset::CameraCalibration& calibration() const override { return calibration_; }

 private:
  dataset::CameraCalibration calibration_;
  std::unique_ptr<dataset::PictureSource> pictures_;
  std::unordered_map<int64_t, dataset::TruthRow> truth_;
};

std::shared_ptr<const simulator::Line> line_of(const simulator::SimulationOptions& options) {
  const auto map =
      options.map ? options.map
                  : std::make_shared<const track::Map>(core::value_or_throw(simulator::builtin_line(options.line)));
  return std::make_shared<const simulator::Line>(core::value_or_throw(
      simulator::Line::make(map, core::value_or_throw(map->parse_position(options.start)), options.run.length_m, {})));
}

class Simulated : public Scene {
 public:
  Simulated(const simulator::SimulationOptions& options, const Disturbances& disturbances)
      : options_(options),
        disturbances_(disturbances),
        scenario_(core::value_or_throw(simulator::Scenario::make(options.scenario, options.seed))),
        calibration_{options.render.camera, options.rate_hz, options.mount},
        line_(line_of(options)),
        trajectory_(line_, options.run, options.mount, options.shake, options.seed),
        renderer_(line_, what_to_draw(options, disturbances, trajectory_)),
        random_(options.seed + 1000) {}

  std::optional<Moment> next() override {
    if (std::optional<Moment> again = repeat()) return again;
    while (random_.uniform() < disturbances_.drop_share) ++count_;
    const double time_s = static_cast<double>(count_++) / options_.rate_hz;
    const bool there_and_back = disturbances_.way == Way::there_and_back;
    if (time_s > (there_and_back ? 2.0 : 1.0) * trajectory_.duration_s()) return std::nullopt;
    const bool back = disturbances_.way == Way::reverse || time_s > trajectory_.duration_s();
    const double run_s = back ? (there_and_back ? 2.0 : 1.0) * trajectory_.duration_s() - time_s : time_s;
    Moment moment;
    moment.truth = trajectory_.truth(run_s);
    if (back) moment.truth.speed_mps = -moment.truth.speed_mps;
    shake(time_s, moment.truth.camera);
    const auto& at = moment.truth;
    const double jitter_s =
        std::clamp(random_.normal(0, disturbances_.stamp_jitter_s), -0.4 / options_.rate_hz, 0.4 / options_.rate_hz);
    moment.stamp_ns = trajectory_.begin_ns() + core::to_ns(time_s + jitter_s) + pause_ns_;
    moment.exposure_s = options_.scenario.exposure.time_s;
    moment.grey =
        renderer_.render({at.camera, at.distance_m, at.speed_mps, options_.scenario.exposure.time_s,
                          scenario_.gain(trajectory_, run_s), random_.next(), scenario_.look(time_s, at.distance_m)});
    remember(moment);
    return moment;
  }
  [[nodiscard]] const dataset::CameraCalibration& calibration() const override { return calibration_; }

 private:
  // Whole numbers of waves in a second, so that a loop of whole seconds has no jump.
  void shake(double time_s, geometry::CameraPose& pose) const {
    const auto wave = [&](double hz, double phase) { return std::sin(2 * std::numbers::pi * hz * time_s + phase); };
    const double by = disturbances_.idle_shake;
    pose.pitch_rad += by * 0.0003 * (wave(7, 0.3) + wave(19, 1.0));
    pose.yaw_rad += by * 0.0002 * wave(11, 2.0);
    pose.roll_rad += by * 0.0003 * wave(13, 0.7);
    pose.lateral_m += by * 0.001 * wave(5, 1.5);
    pose.height_m += by * 0.001 * (wave(3, 0.1) + wave(17, 2.2));
  }
  // At rest, with the stop's last picture behind: the stop again, until it has lasted long enough.
  std::optional<Moment> repeat() {
    const double loop_s = static_cast<double>(rest_.size()) / options_.rate_hz;
    if (rest_.empty() || loop_s < std::floor(options_.run.stop_s) - 1.0) return std::nullopt;
    if (repeated_s_ >= disturbances_.rest_s) return std::nullopt;
    Moment moment = rest_[at_];
    moment.stamp_ns += pause_ns_ + core::to_ns(loop_s);
    if (++at_ == rest_.size()) {
      at_ = 0;
      pause_ns_ += core::to_ns(loop_s);
      repeated_s_ += loop_s;
    }
    return moment;
  }
  void remember(const Moment& moment) {
    const bool stop = disturbances_.rest_s > 0 && moment.truth.speed_mps == 0 && moment.truth.distance_m > 1;
    const double most_s = std::floor(options_.run.stop_s) - 1.0;
    if (stop && static_cast<double>(rest_.size()) / options_.rate_hz < most_s) rest_.push_back(moment);
  }
  static simulator::RenderOptions what_to_draw(const simulator::SimulationOptions& options,
                                               const Disturbances& disturbances,
                                               const simulator::Trajectory& trajectory) {
    simulator::RenderOptions render = options.render;
    render.seed = options.seed;
    render.scenery = disturbances.whole_picture;
    if (disturbances.whole_picture) {
      render.trains = simulator::plan_traffic(trajectory, options.other_trains, options.seed);
    } else {
      render.strip = kDrawn;
    }
    return render;
  }
  simulator::SimulationOptions options_;
  Disturbances disturbances_;
  simulator::Scenario scenario_;
  dataset::CameraCalibration calibration_;
  std::shared_ptr<const simulator::Line> line_;
  simulator::Trajectory trajectory_;
  simulator::Renderer renderer_;
  core::Random random_;
  int64_t count_ = 0;
  std::vector<Moment> rest_;  // of the stop, whole seconds
  size_t at_ = 0;
  double repeated_s_ = 0;
  int64_t pause_ns_ = 0;
};

}  // namespace

std::unique_ptr<Scene> open_dataset(const std::string& folder) {
  return std::make_unique<Dataset>(folder);
}

std::unique_ptr<Scene> simulate_track(const simulator::SimulationOptions& options, const Disturbances& disturbances) {
  return std::make_unique<Simulated>(options, disturbances);
}

}  // namespace railfix
