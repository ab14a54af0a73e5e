#include "run/draw_run.hpp"

#include <spdlog/fmt/fmt.h>

#include <map>
#include <set>

#include "dataset/dataset.hpp"
#include "mcap/reader.hpp"
#include "messaging/camera.hpp"
#include "messaging/topics.hpp"
#include "picture_file.hpp"
#include "progress.hpp"
#include "run/seen_rails.hpp"
#include "track_detector/draw.hpp"

namespace railfix::tool {
namespace {

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
    core::ok_or_throw(write_picture(file, picture));
    progress.update(names.size());
  }
  progress.finish();
  return fmt::format("{}: {} pictures, both rails seen on {}, not seen on {}, left out {}", folder.string(),
                     names.size(), both, names.size() - both - left_out, left_out);
}

}  // namespace railfix::tool
