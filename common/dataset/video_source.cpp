#include "dataset/video_source.hpp"

#include <opencv2/imgproc.hpp>

#include "core/time.hpp"
#include "video/stream.hpp"

namespace railfix::dataset {
namespace {

using core::Error;

/// A decoder that gives nothing for so long gives nothing any more.
constexpr std::chrono::seconds kPatience{60};

/// Frames of a video; their times are frame number / fps, as players do it.
class VideoSource : public PictureSource {
 public:
  VideoSource(std::string name, std::unique_ptr<video::VideoStream> stream, std::optional<video::Frame> first,
              double fps)
      : name_(std::move(name)), stream_(std::move(stream)), waiting_(std::move(first)), fps_(fps) {}

  MaybePicture next() override {
    auto frame = take();
    if (!frame.ok()) return frame.error();
    if (!frame.value()) return std::optional<Picture>();
    const cv::Mat& pixels = frame.value()->pixels;
    Picture picture{*next_stamp_ns(), std::to_string(number_), {}};
    ++number_;
    if (pixels.channels() == 1) {
      picture.grey = pixels.clone();
    } else {
      cv::cvtColor(pixels, picture.grey, cv::COLOR_BGR2GRAY);
      picture.colour = pixels.clone();
    }
    return std::optional<Picture>(std::move(picture));
  }
  [[nodiscard]] std::optional<int64_t> next_stamp_ns() const override {
    return core::to_ns(static_cast<double>(number_) / fps_);
  }
  bool skip() override {
    const auto frame = take();
    if (!frame.ok() || !frame.value()) return false;
    ++number_;
    return true;
  }
  [[nodiscard]] std::optional<size_t> count() const override { return std::nullopt; }

 private:
  /// An error is said once, and is the end.
  core::Result<std::optional<video::Frame>> take() {
    if (waiting_) return std::exchange(waiting_, std::nullopt);
    if (through_) return std::optional<video::Frame>();
    auto frame = stream_->next(kPatience);
    through_ = !frame.ok() || !frame.value();
    if (!frame.ok())
      return Error{name_ + " cannot be decoded behind frame " + std::to_string(number_) + ": " + frame.error().message};
    if (through_ && !stream_->ended())
      return Error{name_ + " gives no picture behind frame " + std::to_string(number_)};
    return frame;
  }

  std::string name_;
  std::unique_ptr<video::VideoStream> stream_;
  std::optional<video::Frame> waiting_;
  double fps_;
  bool through_ = false;
  int64_t number_ = 0;
};

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
  double fps = options.fps > 0 ? options.fps : stream.value()->rate_hz();
  if (!(fps > 0 && fps < 100'000)) fps = kDefaultFps;
  return std::unique_ptr<PictureSource>(
      std::make_unique<VideoSource>(file.string(), std::move(stream).value(), std::move(first).value(), fps));
}

}  // namespace railfix::dataset
