#include "simulator/simulation.hpp"

#include <atomic>
#include <cmath>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/dataset_writer.hpp"

namespace railfix::simulator {
namespace {

constexpr double kTunnelGain = 4.0;
constexpr double kAdaptS = 0.4;  // time constant of the auto-exposure

std::vector<int> encoding(const SimulationOptions& options) {
  if (options.format == "jpg") return {cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality};
  if (options.format == "png") return {cv::IMWRITE_PNG_COMPRESSION, 1};
  return {};
}

// Renders pictures in several threads; every picture depends on its own time only.
class Studio {
 public:
  Studio(const SimulationOptions& options, const Trajectory& trajectory, const Renderer& renderer,
         const DatasetWriter& writer, const std::vector<int64_t>& stamps)
      : options_(options), trajectory_(trajectory), renderer_(renderer), writer_(writer), stamps_(stamps) {}

  core::Status run(const ProgressCall& progress) {
    std::vector<std::thread> helpers;
    for (int i = 1; i < options_.threads; ++i) helpers.emplace_back([this] { work([](size_t, size_t) {}); });
    work(progress);
    for (auto& helper : helpers) helper.join();
    return status_;
  }
  [[nodiscard]] double render_ms() const {
    return stamps_.empty() ? 0.0 : static_cast<double>(render_ns_) * 1e-6 / static_cast<double>(stamps_.size());
  }

 private:
  void work(const ProgressCall& progress) {
    for (size_t k = next_++; k < stamps_.size() && !failed_; k = next_++) {
      const int64_t begin_ns = core::monotonic_ns();
      const cv::Mat picture = renderer_.render(shot(k));
      render_ns_ += core::monotonic_ns() - begin_ns;
      const auto file = writer_.picture_file(picture_name(stamps_[k], options_.format)).string();
      bool written = false;
      try {
        written = cv::imwrite(file, picture, encoding(options_));
      } catch (const cv::Exception&) {
        written = false;
      }
      if (!written) fail(file + " could not be written; is the disk full?");
      progress(++done_, stamps_.size());
    }
  }
  [[nodiscard]] Shot shot(size_t k) const {
    const double time_s = core::seconds(stamps_[k] - trajectory_.begin_ns());
    const auto truth = trajectory_.truth(time_s);
    return {truth.camera,
            truth.distance_m,
            truth.speed_mps,
            options_.exposure_s,
            camera_gain(trajectory_, time_s, options_.gain_wander, options_.seed),
            mix_bits(options_.seed, static_cast<int64_t>(k), 6),
            {}};
  }
  void fail(const std::string& sentence) {
    const std::lock_guard lock(mutex_);
    status_ = core::Error{sentence};
    failed_ = true;
  }

  const SimulationOptions& options_;
  const Trajectory& trajectory_;
  const Renderer& renderer_;
  const DatasetWriter& writer_;
  const std::vector<int64_t>& stamps_;
  std::atomic<size_t> next_ = 0;
  std::atomic<size_t> done_ = 0;
  std::atomic<int64_t> render_ns_ = 0;
  std::atomic<bool> failed_ = false;
  std::mutex mutex_;
  core::Status status_;
};

core::Result<std::shared_ptr<const Line>> make_line(const SimulationOptions& options) {
  auto map = options.map;
  if (!map) {
    auto built_in = builtin_line(options.line);
    if (!built_in.ok()) return built_in.error();
    map = std::make_shared<const track::Map>(std::move(built_in).value());
  }
  const auto start = map->parse_position(options.start);
  if (!start.ok()) return start.error();
  std::vector<uint32_t> via;
  for (const auto& name : options.via) {
    const auto place = map->parse_position(name + ":0");
    if (!place.ok()) return place.error();
    via.push_back(place.value().edge);
  }
  const double ahead_m =
      options.run.length_m > 0.0 ? options.run.length_m : options.run.duration_s * options.run.cruise_mps;
  auto line = Line::make(map, start.value(), ahead_m, via);
  if (!line.ok()) return line.error();
  return std::shared_ptr<const Line>(std::make_shared<Line>(std::move(line).value()));
}

}  // namespace

double camera_gain(const Trajectory& trajectory, double time_s, double wander, uint64_t seed) {
  // First-order lag behind the light over the last two seconds.
  double gain = 0.0;
  double weights = 0.0;
  for (double back_s = 0.0; back_s < 2.0; back_s += 0.1) {
    const double weight = std::exp(-back_s / kAdaptS);
    const double ahead_m = trajectory.motion(std::max(0.0, time_s - back_s)).distance_m + 8.0;
    const double dark = 1.0 - std::exp(-trajectory.line().depth_in_tunnel_m(ahead_m) / 12.0);
    gain += weight * (1.0 + (kTunnelGain - 1.0) * dark);
    weights += weight;
  }
  const double phase = 6.28 * static_cast<double>(unit_float(mix_bits(seed, 8)));
  return gain / weights * (1.0 + wander * (std::sin(0.31 * time_s + phase) + std::sin(1.13 * time_s + 2.0 * phase)));
}

core::Result<SimulationReport> simulate(const SimulationOptions& options, const ProgressCall& progress) {
  const auto line = make_line(options);
  if (!line.ok()) return line.error();
  const auto writer = DatasetWriter::create(options.out);
  if (!writer.ok()) return writer.error();
  const Trajectory trajectory(line.value(), options.run, options.mount, options.shake, options.seed);
  std::vector<int64_t> stamps;
  for (int64_t k = 0; static_cast<double>(k) / options.rate_hz <= trajectory.duration_s(); ++k) {
    stamps.push_back(trajectory.begin_ns() + core::to_ns(static_cast<double>(k) / options.rate_hz));
  }
  const SensorModel sensors(trajectory, options.sensors, options.seed);
  const auto& out = writer.value();
  dataset::CameraCalibration calibration{options.render.camera, options.rate_hz, options.mount};
  const auto pictures = options.pictures ? stamps : std::vector<int64_t>();
  for (const auto& status :
       {out.write_camera(calibration, pictures, options.format), out.write_sensors(sensors, options.sensors),
        out.write_truth(trajectory, stamps, options.render.camera), out.write_map(line.value()->path().map())}) {
    if (!status.ok()) return status.error();
  }
  SimulationReport report{pictures.size(), trajectory.duration_s(), trajectory.length_m(), 0.0};
  if (options.pictures) {
    auto render = options.render;
    render.seed = options.seed;
    const Renderer renderer(line.value(), render);
    Studio studio(options, trajectory, renderer, out, pictures);
    if (const auto status = studio.run(progress); !status.ok()) return status.error();
    report.render_ms = studio.render_ms();
  }
  return report;
}

}  // namespace railfix::simulator
