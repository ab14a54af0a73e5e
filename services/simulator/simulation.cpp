#include "simulator/simulation.hpp"

#include <atomic>
#include <cmath>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/dataset_writer.hpp"
#include "simulator/traffic.hpp"

namespace railfix::simulator {
namespace {

std::vector<int> encoding(const SimulationOptions& options) {
  if (options.format == "jpg") return {cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality};
  if (options.format == "png") return {cv::IMWRITE_PNG_COMPRESSION, 1};
  return {};
}

// Renders pictures in several threads; every picture depends on its own time only.
class Studio {
 public:
  struct Set {
    const SimulationOptions& options;
    const Scenario& scenario;
    const Trajectory& trajectory;
    const Renderer& renderer;
    const DatasetWriter& writer;
    const std::vector<Exposure>& exposures;
  };
  explicit Studio(const Set& set) : set_(set), visibilities_(set.exposures.size()) {}

  core::Status run(const ProgressCall& progress) {
    std::vector<std::thread> helpers;
    for (int i = 1; i < set_.options.threads; ++i) helpers.emplace_back([this] { work([](size_t, size_t) {}); });
    work(progress);
    for (auto& helper : helpers) helper.join();
    return status_;
  }
  [[nodiscard]] double render_ms() const {
    return done_ == 0 ? 0.0 : static_cast<double>(render_ns_) * 1e-6 / static_cast<double>(done_);
  }
  [[nodiscard]] size_t pictures() const { return done_; }
  [[nodiscard]] const std::vector<Visibility>& visibilities() const { return visibilities_; }

 private:
  void work(const ProgressCall& progress) {
    const auto& exposures = set_.exposures;
    const auto& format = set_.options.format;
    for (size_t k = next_++; k < exposures.size() && !failed_; k = next_++) {
      if (exposures[k].dropped) continue;
      const int64_t begin_ns = core::monotonic_ns();
      const Shot one = shot(k);
      const cv::Mat picture = set_.renderer.render(one);
      render_ns_ += core::monotonic_ns() - begin_ns;
      visibilities_[k] = {set_.renderer.rails_visible(one), one.gain};
      const auto file = set_.writer.picture_file(picture_name(exposures[k].stamp_ns, format)).string();
      bool written = false;
      try {
        written = cv::imwrite(file, picture, encoding(set_.options));
      } catch (const cv::Exception&) {
        written = false;
      }
      if (!written) fail(file + " could not be written; is the disk full?");
      progress(++done_, exposures.size());
    }
  }
  [[nodiscard]] Shot shot(size_t k) const {
    const double time_s = core::seconds(set_.exposures[k].exposed_ns - set_.trajectory.begin_ns());
    const auto truth = set_.trajectory.truth(time_s);
    return {truth.camera,
            truth.distance_m,
            truth.speed_mps,
            set_.options.scenario.exposure.time_s,
            set_.scenario.gain(set_.trajectory, time_s),
            mix_bits(set_.options.seed, static_cast<int64_t>(k), 6),
            set_.scenario.look(time_s, truth.distance_m)};
  }
  void fail(const std::string& sentence) {
    const std::lock_guard lock(mutex_);
    status_ = core::Error{sentence};
    failed_ = true;
  }

  Set set_;
  std::vector<Visibility> visibilities_;
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
  const auto& path = line.value().path();
  const auto run_over = edges_between(path, 0.0, std::min(ahead_m, path.end_m()));
  for (size_t i = 0; i < via.size(); ++i) {
    if (!run_over.contains(via[i])) {
      return core::Error{"--via " + options.via[i] + ": the way from " + options.start +
                         " does not come to it within " + std::to_string(std::lround(ahead_m)) +
                         " m; name the edge behind the switch to turn at"};
    }
  }
  return std::shared_ptr<const Line>(std::make_shared<Line>(std::move(line).value()));
}

}  // namespace

core::Result<SimulationReport> simulate(const SimulationOptions& options, const ProgressCall& progress) {
  const auto line = make_line(options);
  if (!line.ok()) return line.error();
  auto scenario = Scenario::make(options.scenario, options.seed);
  if (!scenario.ok()) return scenario.error();
  const Trajectory trajectory(line.value(), options.run, options.mount, options.shake, options.seed);
  if (options.run.stop_at_m >= trajectory.length_m() && options.run.stop_at_m > 0.0) {
    return core::Error{"--stop-at-m: the train runs " + std::to_string(std::lround(trajectory.length_m())) +
                       " m only and cannot stop beyond"};
  }
  const auto writer = DatasetWriter::create(options.out);
  if (!writer.ok()) return writer.error();
  const auto exposures = scenario.value().exposures(trajectory, options.rate_hz);
  const SensorModel sensors(trajectory, options.sensors, options.seed);
  const auto& out = writer.value();
  const auto trains = plan_traffic(trajectory, options.other_trains, options.seed);
  dataset::CameraCalibration calibration{options.render.camera, options.rate_hz, options.mount};
  const auto pictures = options.pictures ? exposures : std::vector<Exposure>();
  for (const auto& status :
       {out.write_camera(calibration, pictures, options.format), out.write_sensors(sensors, options.sensors),
        out.write_truth(trajectory, exposures, options.render.camera), out.write_map(line.value()->path().map()),
        out.write_trains(trains), out.write_description(options.description)}) {
    if (!status.ok()) return status.error();
  }
  SimulationReport report{0, trajectory.duration_s(), trajectory.length_m(), 0.0};
  if (options.pictures) {
    auto render = options.render;
    render.seed = options.seed;
    render.trains = trains;
    const Renderer renderer(line.value(), render);
    Studio studio({options, scenario.value(), trajectory, renderer, out, pictures});
    if (const auto status = studio.run(progress); !status.ok()) return status.error();
    if (const auto status = out.write_visibility(pictures, studio.visibilities()); !status.ok()) return status.error();
    report.pictures = studio.pictures();
    report.render_ms = studio.render_ms();
  }
  return report;
}

}  // namespace railfix::simulator
