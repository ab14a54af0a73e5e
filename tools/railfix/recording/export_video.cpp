#include "recording/export_video.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "core/time.hpp"
#include "core/units.hpp"
#include "core/whole_file.hpp"
#include "draft.hpp"
#include "messaging/camera.hpp"
#include "messaging/topics.hpp"
#include "progress.hpp"
#include "recording/mp4_file.hpp"
#include "recording/utc_text.hpp"
#include "run/seen_rails.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr double kLeastFps = 1;
constexpr double kMostFps = 120;
constexpr double kOldPictureS = 0.5;
constexpr int64_t kOldStateNs = core::kNsPerSecond;

/// All that is drawn into pictures; small beside them.
struct Drawn {
  std::map<int64_t, msg::TrackView> views;  // by the picture's stamp
  std::map<int64_t, msg::TrainState> states;
  std::optional<geometry::Intrinsics> camera;
  std::map<std::string, uint64_t> unreadable;  // samples of each topic
};

struct Picture {
  int64_t stamp_ns = 0;
  cv::Mat grey;
};

std::string camera_of(const std::string& topic) {
  return topic.substr(topic.find('/') + 1);
}

/// The channel with the best pictures: full frames, or JPEG of them, before previews.
core::Result<mcap::Channel> picture_channel(const mcap::Reader& reader, const VideoOptions& options) {
  for (const char* base : {topics::camera_frame.name, topics::camera_preview.name}) {
    for (const auto& [id, channel] : reader.channels()) {
      if (!channel.topic.starts_with(std::string(base) + "/")) continue;
      if (!options.camera.empty() && camera_of(channel.topic) != options.camera) continue;
      const auto counted = reader.statistics().channel_messages.find(id);
      if (counted != reader.statistics().channel_messages.end() && counted->second > 0) return channel;
    }
  }
  return core::Error{reader.file().string() + " has no pictures" +
                     (options.camera.empty() ? "" : " of camera " + options.camera)};
}

Drawn read_drawn(mcap::Reader& reader, const mcap::Selection& part, const std::string& camera) {
  Drawn drawn;
  mcap::Selection selection{{topics::camera_calibration.name}, {}, part.to_ns};
  reader.for_each(selection, [&](const mcap::Channel&, const mcap::Message& message) {
    msg::CameraCalibration calibration;
    if (!messaging::deserialize({message.data.begin(), message.data.end()}, calibration)) return true;
    if (calibration.camera() == camera.c_str()) drawn.camera = messaging::intrinsics_of(calibration);
    return true;
  });
  selection = part;
  selection.topics = {topics::track_view.name, topics::train_state.name};
  reader.for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    const std::vector<uint8_t> cdr(message.data.begin(), message.data.end());
    if (msg::TrackView view; channel.topic == topics::track_view.name && messaging::deserialize(cdr, view)) {
      drawn.views[view.stamp_ns()] = view;
    } else if (msg::TrainState state; channel.topic == topics::train_state.name && messaging::deserialize(cdr, state)) {
      drawn.states[state.stamp_ns()] = state;
    } else {
      ++drawn.unreadable[channel.topic];
    }
    return true;
  });
  return drawn;
}

std::optional<Picture> decode(const std::string& type, const mcap::Message& message) {
  const std::vector<uint8_t> cdr(message.data.begin(), message.data.end());
  if (type == messaging::type_of<msg::CameraFrame>().name()) {
    const auto frame = std::make_unique<msg::CameraFrame>();
    if (!messaging::deserialize(cdr, *frame)) return std::nullopt;
    const cv::Mat pixels(static_cast<int>(frame->height_px()), static_cast<int>(frame->width_px()), CV_8UC1,
                         frame->data().data());
    if (pixels.empty() || pixels.total() > frame->data().size()) return std::nullopt;
    return Picture{frame->stamp_ns(), pixels.clone()};
  }
  msg::CameraPreview preview;
  if (!messaging::deserialize(cdr, preview) || preview.jpeg().empty()) return std::nullopt;
  Picture picture{preview.stamp_ns(), cv::imdecode(preview.jpeg(), cv::IMREAD_GRAYSCALE)};
  if (picture.grey.empty()) return std::nullopt;
  return picture;
}

std::string place_text(const Drawn& drawn, int64_t stamp_ns) {
  if (drawn.states.empty()) return "no position recorded";
  const auto behind = drawn.states.upper_bound(stamp_ns);
  if (behind == drawn.states.begin()) return "place not yet known";
  const auto& state = std::prev(behind)->second;
  if (stamp_ns - state.stamp_ns() > kOldStateNs) return "no position for more than a second";
  const std::string speed = std::isnan(state.speed_mps())
                                ? "speed unknown"
                                : fmt::format("{:.1f} km/h", core::kmh_from_mps(state.speed_mps()));
  if (state.track_known() == 0) return speed + "  track not known";
  return fmt::format("{}  edge {} at {:.1f} m -{:.1f} +{:.1f} m", speed, state.edge(), state.offset_m(), state.over_m(),
                     state.under_m());
}

void write_line(cv::Mat& picture, int line, const std::string& text) {
  const double scale = std::max(0.4, picture.cols / 1600.0);
  const cv::Point at(static_cast<int>(10 * scale), picture.rows - static_cast<int>((10 + 26 * line) * scale));
  const int width = std::max(1, static_cast<int>(std::lround(2 * scale)));
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {0, 0, 0}, width + 2, cv::LINE_AA);
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {255, 255, 255}, width, cv::LINE_AA);
}

/// Draws pictures and makes a film of them, each standing until the next was taken.
class Film {
 public:
  Film(const Drawn& drawn, double fps, std::filesystem::path file)
      : drawn_(drawn), file_(std::move(file)), period_ns_(core::to_ns(1 / fps)) {
    report_.fps = fps;
  }

  core::Status add(const Picture& picture) {
    if (begun_ns_ && picture.stamp_ns <= shown_stamp_ns_) return {};  // older than the one shown: out of order
    if (!begun_ns_) {
      begun_ns_ = picture.stamp_ns;
      size_ = drawn_.camera && drawn_.camera->width_px > 0 ? cv::Size(drawn_.camera->width_px, drawn_.camera->height_px)
                                                           : picture.grey.size();
      size_ = {size_.width & ~1, size_.height & ~1};  // H.264 halves the colours
      if (auto status = open(); !status.ok()) return status;
    }
    show_until(picture.stamp_ns);
    shown_ = draw(picture);
    shown_stamp_ns_ = picture.stamp_ns;
    ++report_.pictures;
    return {};
  }
  VideoReport finish() {
    if (begun_ns_) show_until(shown_stamp_ns_ + period_ns_);
    video_.release();
    return report_;
  }

 private:
  core::Status open() {
    for (const auto& [name, code] : {std::pair("H.264", cv::VideoWriter::fourcc('a', 'v', 'c', '1')),
                                     std::pair("MPEG-4", cv::VideoWriter::fourcc('m', 'p', '4', 'v'))}) {
      report_.codec = name;
      if (video_.open(file_.string(), cv::CAP_FFMPEG, code, report_.fps, size_)) return {};
    }
    return core::Error{
        fmt::format("no film of {} x {} pixels can be made: OpenCV's FFmpeg has neither H.264 nor MPEG-4", size_.width,
                    size_.height)};
  }
  void show_until(int64_t stamp_ns) {
    if (shown_.empty()) return;
    for (; *begun_ns_ + static_cast<int64_t>(report_.frames) * period_ns_ < stamp_ns; ++report_.frames) {
      const double old_s =
          core::seconds(*begun_ns_ + static_cast<int64_t>(report_.frames) * period_ns_ - shown_stamp_ns_);
      if (old_s < kOldPictureS) {
        video_.write(shown_);
        continue;
      }
      cv::Mat old = shown_.clone();
      write_line(old, 2, fmt::format("no picture for {:.1f} s", old_s));
      video_.write(old);
    }
  }
  cv::Mat draw(const Picture& picture) {
    cv::Mat grey = picture.grey;
    if (grey.size() != size_) cv::resize(picture.grey, grey, size_, 0, 0, cv::INTER_LINEAR);
    cv::Mat colour;
    cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
    const auto view = drawn_.views.find(picture.stamp_ns);
    if (view != drawn_.views.end() && drawn_.camera) {
      const auto observation = observation_of(view->second, *drawn_.camera);
      track_detector::draw_track(colour, *drawn_.camera, observation, kGaugeM);
      if (observation.seen()) ++report_.with_rails;
    } else {
      track_detector::draw_words(colour, {drawn_.camera ? "no answer of track_detector" : "no calibration recorded"});
    }
    write_line(colour, 1, utc_text(picture.stamp_ns));
    write_line(colour, 0, place_text(drawn_, picture.stamp_ns));
    return colour;
  }

  const Drawn& drawn_;
  std::filesystem::path file_;
  int64_t period_ns_;
  VideoReport report_;
  cv::VideoWriter video_;
  cv::Size size_;
  std::optional<int64_t> begun_ns_;
  int64_t shown_stamp_ns_ = 0;
  cv::Mat shown_;
};

/// The usual distance of the pictures, by the first of them.
double usual_fps(mcap::Reader& reader, const mcap::Selection& part, const std::string& type) {
  constexpr size_t kLooked = 60;
  std::vector<int64_t> stamps_ns;
  reader.for_each(part, [&](const mcap::Channel&, const mcap::Message& message) {
    if (const auto picture = decode(type, message)) stamps_ns.push_back(picture->stamp_ns);
    return stamps_ns.size() < kLooked;
  });
  std::vector<int64_t> gaps_ns;
  for (size_t i = 1; i < stamps_ns.size(); ++i) gaps_ns.push_back(stamps_ns[i] - stamps_ns[i - 1]);
  std::ranges::sort(gaps_ns);
  if (gaps_ns.empty() || gaps_ns[gaps_ns.size() / 2] <= 0) return kLeastFps;
  const double fps = 1 / core::seconds(gaps_ns[gaps_ns.size() / 2]);
  return std::clamp(std::round(fps * 100) / 100, kLeastFps, kMostFps);
}

core::Result<VideoReport> make_film(mcap::Reader& reader, const mcap::Selection& part, const VideoOptions& options,
                                    const mcap::Channel& channel, const std::filesystem::path& file) {
  const std::string type = reader.schemas().at(channel.schema_id).name;
  const Drawn drawn = read_drawn(reader, part, camera_of(channel.topic));
  mcap::Selection pictures = part;
  pictures.topics = {channel.topic};
  Film film(drawn, options.fps > 0 ? options.fps : usual_fps(reader, pictures, type), file);
  Progress progress("film", reader.statistics().channel_messages.at(channel.id));
  core::Status status;
  uint64_t done = 0;
  reader.for_each(pictures, [&](const mcap::Channel&, const mcap::Message& message) {
    if (const auto picture = decode(type, message)) status = film.add(*picture);
    progress.update(++done);
    return status.ok();
  });
  progress.finish();
  if (!status.ok()) return status.error();
  auto report = film.finish();
  for (const auto& [topic, count] : drawn.unreadable) {
    report.problems.push_back(topic + ": " + std::to_string(count) +
                              " samples are not of this version's type and are not drawn");
  }
  if (report.pictures == 0) return core::Error{reader.file().string() + ": no picture of the part can be read"};
  return report;
}

}  // namespace

core::Result<VideoReport> export_video(mcap::Reader& reader, const mcap::Selection& part, const VideoOptions& options,
                                       const std::filesystem::path& file) {
  const auto channel = picture_channel(reader, options);
  if (!channel.ok()) return channel.error();
  const auto draft = Draft::beside(file, ".mp4");  // FFmpeg makes what the name ends in
  if (!draft.ok()) return draft.error();
  const auto& film = draft.value()->file();
  auto report = make_film(reader, part, options, channel.value(), film);
  auto status = report.ok() ? whole_mp4(film, file.string()) : takes_more(film, file.string());
  if (status.ok() && !report.ok()) return report;
  if (status.ok()) status = core::move_draft(film, file);
  if (!status.ok()) return status.error();
  return report;
}

}  // namespace railfix::tool
