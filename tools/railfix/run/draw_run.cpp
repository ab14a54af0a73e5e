#include "run/draw_run.hpp"

#include <spdlog/fmt/fmt.h>

#include <array>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "dataset/dataset.hpp"
#include "mcap/reader.hpp"
#include "messaging/camera.hpp"
#include "messaging/topics.hpp"
#include "progress.hpp"
#include "track_detector/draw.hpp"

namespace railfix::tool {
namespace {

constexpr double kGaugeM = 1.435;

struct SeenByTheRun {
  std::map<int64_t, msg::TrackView> views;  // by the picture's stamp
  msg::CameraCalibration calibration;
};

SeenByTheRun read_views(const std::filesystem::path& file) {
  const auto recording = core::value_or_throw(mcap::Reader::open(file));
  SeenByTheRun seen;
  mcap::Selection selection;
  selection.topics = {"track_view", "camera_calibration"};
  recording->for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    const std::vector<uint8_t> cdr(message.data.begin(), message.data.end());
    if (channel.topic == "camera_calibration") {
      static_cast<void>(messaging::deserialize(cdr, seen.calibration));
    } else if (msg::TrackView view; messaging::deserialize(cdr, view)) {
      seen.views[view.stamp_ns()] = view;
    }
    return true;
  });
  return seen;
}

void unpack(const std::array<double, 28>& upper, Eigen::Matrix<double, 7, 7>& covariance) {
  size_t k = 0;
  for (int r = 0; r < 7; ++r) {
    for (int c = r; c < 7; ++c) covariance(r, c) = covariance(c, r) = upper[k++];
  }
}

// track_view leaves out how far the rails were followed and the change of curvature; the edge points still show both.
void complete_from_points(const geometry::Intrinsics& camera, track_detector::TrackObservation& observation) {
  const geometry::View view(camera, observation.shape.camera);
  auto& shape = observation.shape;
  double near_m = std::numeric_limits<double>::infinity();
  double far_m = 0;
  double left_over = 0;
  double weight = 0;
  for (const auto& point : observation.points) {
    auto place = view.on_plane(point.pixel, 0);
    if (place) place = view.on_plane(point.pixel, shape.vertical_curvature_per_m * place->x() * place->x() / 2);
    if (!place) continue;
    const double x = place->x();
    near_m = std::min(near_m, x);
    far_m = std::max(far_m, x);
    const double residual_m = place->y() - rail_point(shape, point.side, kGaugeM, x).y();
    left_over += residual_m * x;  // times x^3 / 6, by the 1 / x^2 that makes metres pixels
    weight += x * x * x * x / 6;
  }
  observation.near_m = near_m;
  observation.far_m = far_m;
  if (weight > 0) shape.curvature_rate_per_m2 = left_over / weight;
}

track_detector::TrackObservation observation_of(const msg::TrackView& view, const geometry::Intrinsics& camera) {
  track_detector::TrackObservation observation;
  observation.seen_left = view.seen_left() != 0;
  observation.seen_right = view.seen_right() != 0;
  observation.shape.camera = {view.roll_rad(), view.pitch_rad(), view.yaw_rad(), view.lateral_m(), view.height_m()};
  observation.shape.curvature_per_m = view.curvature_per_m();
  observation.shape.vertical_curvature_per_m = view.vertical_curvature_per_m();
  observation.residual_px = view.residual_px();
  observation.confidence = view.confidence();
  const auto add = [&](const auto& u_px, const auto& v_px, uint32_t count, track_detector::Side side) {
    for (uint32_t i = 0; i < count && i < u_px.size(); ++i) {
      track_detector::EdgePoint point;
      point.pixel = {u_px[i], v_px[i]};
      point.side = side;
      observation.points.push_back(point);
    }
  };
  add(view.left_u_px(), view.left_v_px(), view.left_points(), track_detector::Side::left);
  add(view.right_u_px(), view.right_v_px(), view.right_points(), track_detector::Side::right);
  unpack(view.covariance(), observation.covariance);
  complete_from_points(camera, observation);
  return observation;
}

// A name for each picture: files keep theirs, frames of a video are numbered so that they sort.
std::string drawing_name(const std::string& picture_name, std::set<std::string>& taken) {
  const std::filesystem::path name(picture_name);
  std::string drawing = name.has_extension() ? name.stem().string() : fmt::format("{:0>6}", picture_name);
  if (!taken.insert(drawing).second) taken.insert(drawing = picture_name);
  return drawing + ".jpg";
}

}  // namespace

std::string draw_run(const RunOptions& options, const std::filesystem::path& recording,
                     const std::filesystem::path& folder) {
  const auto seen = read_views(recording);
  const auto camera = messaging::intrinsics_of(seen.calibration);
  std::filesystem::create_directories(folder);
  dataset::PictureOptions picture_options;
  picture_options.fps = options.fps;
  picture_options.colour = true;
  const auto source = core::value_or_throw(dataset::open_pictures(options.source, picture_options));
  Progress progress("draw", source->count().value_or(0));
  std::set<std::string> names;
  size_t both = 0;
  size_t left_out = 0;
  while (true) {
    auto next = source->next();
    if (!next.ok()) continue;  // the run has named the broken picture already
    if (!next.value()) break;
    cv::Mat& picture = next.value()->colour;
    const auto view = seen.views.find(next.value()->stamp_ns);
    if (view == seen.views.end()) {
      ++left_out;
      track_detector::draw_words(picture, {"no answer of track_detector: this picture was left out"});
    } else {
      const auto observation = observation_of(view->second, camera);
      track_detector::draw_track(picture, camera, observation, kGaugeM);
      if (observation.seen()) ++both;
    }
    const auto file = folder / drawing_name(next.value()->name, names);
    if (!cv::imwrite(file.string(), picture)) throw core::BadInput(file.string() + " cannot be written");
    progress.update(names.size());
  }
  progress.finish();
  return fmt::format("{}: {} pictures, both rails seen on {}, not seen on {}, left out {}", folder.string(),
                     names.size(), both, names.size() - both - left_out, left_out);
}

}  // namespace railfix::tool
