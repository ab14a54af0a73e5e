#include "dataset/video_source.hpp"

#include <cmath>
#include <cstdio>
#include <deque>
#include <opencv2/imgproc.hpp>

#include "core/time.hpp"
#include "video/stream.hpp"

namespace railfix::dataset {
namespace {

using core::Error;

/// A decoder that gives nothing for so long gives nothing any more.
constexpr std::chrono::seconds kPatience{60};

/// What a container may round a time to: Matroska has whole milliseconds.
constexpr int64_t kRoundingNs = 600'000;

/// When the frames of a film are shown, since the first one.
class FilmTimes {
 public:
  /// Frames at this rate, whatever the film says.
  static FilmTimes counted(double rate_hz) { return {std::nullopt, rate_hz}; }
  /// As the film says; the rate may be 0.
  static FilmTimes told(int64_t first_ns, double rate_hz) { return {first_ns, rate_hz}; }

  /// Asked of every frame in turn. An error lacks its subject.
  core::Result<int64_t> of(int64_t number, const video::Frame& frame) {
    if (!first_ns_) return core::to_ns(static_cast<double>(number) / rate_hz_);
    if (!frame.at_ns) return Error{"has no time in the film"};
    const int64_t since_ns = *frame.at_ns - *first_ns_;
    if (newest_ns_ && since_ns <= *newest_ns_) return Error{not_behind(since_ns)};
    newest_ns_ = since_ns;
    return unrounded_ns(since_ns);
  }

 private:
  FilmTimes(std::optional<int64_t> first_ns, double rate_hz)
      : first_ns_(first_ns), rate_hz_(rate_hz), even_(rate_hz > 0) {}

  [[nodiscard]] std::string not_behind(int64_t since_ns) const {
    char text[120];
    std::snprintf(text, sizeof text, "is at %.3f s in the film, not behind the frame before it at %.3f s",
                  core::seconds(since_ns), core::seconds(*newest_ns_));
    return text;
  }
  /// A film of one rate, with or without gaps, has its frames at multiples of the period.
  int64_t unrounded_ns(int64_t since_ns) {
    if (!even_) return since_ns;
    const int64_t even_ns = core::to_ns(std::round(core::seconds(since_ns) * rate_hz_) / rate_hz_);
    even_ = std::abs(even_ns - since_ns) <= kRoundingNs && even_ns > even_newest_ns_;
    if (even_) even_newest_ns_ = even_ns;
    return even_ ? even_ns : since_ns;
  }

  std::optional<int64_t> first_ns_;
  double rate_hz_;
  bool even_;
  int64_t even_newest_ns_ = -1;
  std::optional<int64_t> newest_ns_;
};

/// Decoded frames one after the other.
class Film {
 public:
  using MaybeFrame = core::Result<std::optional<video::Frame>>;
  Film(std::string name, video::Frame first, std::unique_ptr<video::VideoStream> stream)
      : name_(std::move(name)), stream_(std::move(stream)) {
    ahead_.emplace_back(std::optional(std::move(first)));
  }

  /// The one that take() will give, or one further behind it.
  const MaybeFrame& peek(size_t ahead = 0) {
    while (ahead_.size() <= ahead) ahead_.push_back(decode());
    return ahead_[ahead];
  }
  /// An error is said once, and is the end.
  MaybeFrame take() {
    (void)peek();
    MaybeFrame frame = std::move(ahead_.front());
    ahead_.pop_front();
    return frame;
  }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] double rate_hz() const { return stream_->rate_hz(); }

 private:
  MaybeFrame decode() {
    if (through_) return std::optional<video::Frame>();
    auto frame = stream_->next(kPatience);
    through_ = !frame.ok() || !frame.value();
    if (!frame.ok()) {
      return Error{name_ + " cannot be decoded behind frame " + std::to_string(decoded_) + ": " +
                   frame.error().message};
    }
    if (through_ && !stream_->ended())
      return Error{name_ + " gives no picture behind frame " + std::to_string(decoded_)};
    ++decoded_;
    return frame;
  }

  std::string name_;
  std::unique_ptr<video::VideoStream> stream_;
  std::deque<MaybeFrame> ahead_;
  bool through_ = false;
  int64_t decoded_ = 1;
};

Picture picture_of(int64_t stamp_ns, std::string name, const cv::Mat& pixels) {
  Picture picture{stamp_ns, std::move(name), {}};
  if (pixels.channels() == 1) {
    picture.grey = pixels.clone();
  } else {
    cv::cvtColor(pixels, picture.grey, cv::COLOR_BGR2GRAY);
    picture.colour = pixels.clone();
  }
  return picture;
}

/// One frame is decoded ahead: only that tells its time.
class VideoSource : public PictureSource {
 public:
  VideoSource(Film film, FilmTimes times) : film_(std::move(film)), times_(times) { look_ahead(); }

  MaybePicture next() override {
    const auto frame = film_.take();
    if (!frame.ok()) return frame.error();
    if (!frame.value()) return std::optional<Picture>();
    const auto stamp_ns = *stamp_ns_;
    const std::string name = std::to_string(number_);
    ++number_;
    look_ahead();
    if (!stamp_ns.ok())
      return Error{film_.name() + " frame " + name + " " + stamp_ns.error().message + "; it is left out"};
    return std::optional(picture_of(stamp_ns.value(), name, frame.value()->pixels));
  }
  [[nodiscard]] std::optional<int64_t> next_stamp_ns() const override {
    return stamp_ns_ && stamp_ns_->ok() ? std::optional(stamp_ns_->value()) : std::nullopt;
  }
  bool skip() override {
    if (!stamp_ns_) return false;
    (void)film_.take();
    ++number_;
    look_ahead();
    return true;
  }
  [[nodiscard]] std::optional<size_t> count() const override { return std::nullopt; }

 private:
  void look_ahead() {
    stamp_ns_.reset();
    const auto& frame = film_.peek();
    if (frame.ok() && frame.value()) stamp_ns_ = times_.of(number_, *frame.value());
  }

  Film film_;
  FilmTimes times_;
  int64_t number_ = 0;
  std::optional<core::Result<int64_t>> stamp_ns_;  // of the next frame; nothing where there is none
};

/// What has no container has a time for its first frame at most.
core::Result<FilmTimes> times_of(Film& film, double asked_fps) {
  if (asked_fps > 0) return FilmTimes::counted(asked_fps);
  const auto timed = [&film](size_t ahead) {
    const auto& frame = film.peek(ahead);
    return !frame.ok() || !frame.value() || frame.value()->at_ns;
  };
  if (timed(0) && timed(1)) return FilmTimes::told(*film.peek().value()->at_ns, film.rate_hz());
  if (film.rate_hz() > 0) return FilmTimes::counted(film.rate_hz());
  return Error{film.name() +
               " says neither when its pictures are shown nor their rate; give the rate (fps), or put it into a "
               "container that holds times (MP4, Matroska)"};
}

}  // namespace

MaybeSource open_video(const std::filesystem::path& file, const PictureOptions& options) {
  const auto refused = [&file](const std::string& why) {
    return Error{file.string() + " is neither a picture nor a video that can be opened: " + why};
  };
  auto stream =
      video::open_file(file, video::Pace::as_asked, options.colour ? video::Colours::bgr : video::Colours::grey);
  if (!stream.ok()) return refused(stream.error().message);
  auto first = stream.value()->next(kPatience);
  if (!first.ok()) return refused(first.error().message);
  if (!first.value()) return refused("it gives no picture");
  Film film(file.string(), *std::move(first).value(), std::move(stream).value());
  const auto times = times_of(film, options.fps);
  if (!times.ok()) return times.error();
  return std::unique_ptr<PictureSource>(std::make_unique<VideoSource>(std::move(film), times.value()));
}

}  // namespace railfix::dataset
