#include "video/stream.hpp"

#include <gst/app/gstappsink.h>
#include <gst/base/gstbasesrc.h>
#include <gst/pbutils/pbutils.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "video/gstreamer.hpp"

namespace railfix::video {
namespace {

using core::Error;
using core::Result;
using std::chrono::milliseconds;
using MaybeStream = Result<std::unique_ptr<VideoStream>>;

/// Decoders give one of the luma formats, of which the luma is taken without any conversion; others become BGR.
constexpr const char* kForGrey =
    "video/x-raw, format=(string){ GRAY8, I420, YV12, NV12, NV21, Y42B, Y444, YUY2, UYVY, BGR }";
constexpr const char* kForColours = "video/x-raw, format=(string)BGRx";
constexpr const char* kToPixels = " ! videoconvert ! appsink";
/// Of a film the pictures, not the sound.
constexpr const char* kFromUri = "uridecodebin name=source expose-all-streams=false caps=video/x-raw(ANY)";
/// How often the bus is asked while there are no pictures.
constexpr milliseconds kStep{20};

GstClockTime gst_time(milliseconds time) {
  return static_cast<GstClockTime>(time.count()) * GST_MSECOND;
}

/// The pixels of a sample as they lie in GStreamer's memory.
class MappedSample {
 public:
  explicit MappedSample(Sample sample) : sample_(std::move(sample)) {
    GstCaps* const caps = gst_sample_get_caps(sample_.get());
    GstVideoInfo info;
    mapped_ = caps != nullptr && gst_video_info_from_caps(&info, caps) != FALSE &&
              gst_video_frame_map(&frame_, &info, gst_sample_get_buffer(sample_.get()), GST_MAP_READ) != FALSE;
  }
  ~MappedSample() {
    if (mapped_) gst_video_frame_unmap(&frame_);
  }
  MappedSample(const MappedSample&) = delete;
  MappedSample& operator=(const MappedSample&) = delete;

  /// Refers to GStreamer's memory where that holds what is wanted.
  [[nodiscard]] cv::Mat pixels() {
    if (!mapped_) return {};
    cv::Mat converted;
    switch (GST_VIDEO_FRAME_FORMAT(&frame_)) {
      case GST_VIDEO_FORMAT_GRAY8:
        return first_plane(CV_8UC1);
      case GST_VIDEO_FORMAT_BGR:
        cv::cvtColor(first_plane(CV_8UC3), converted, cv::COLOR_BGR2GRAY);
        return converted;
      case GST_VIDEO_FORMAT_BGRx:
        cv::cvtColor(first_plane(CV_8UC4), converted, cv::COLOR_BGRA2BGR);
        return converted;
      default:
        return luma();
    }
  }
  [[nodiscard]] double rate_hz() const {
    if (!mapped_ || frame_.info.fps_d == 0) return 0;
    return static_cast<double>(frame_.info.fps_n) / frame_.info.fps_d;
  }

 private:
  [[nodiscard]] cv::Mat first_plane(int type) const {
    return {GST_VIDEO_FRAME_HEIGHT(&frame_), GST_VIDEO_FRAME_WIDTH(&frame_), type,
            GST_VIDEO_FRAME_PLANE_DATA(&frame_, 0), static_cast<size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, 0))};
  }
  [[nodiscard]] cv::Mat luma() const {
    cv::Mat luma;
    if (GST_VIDEO_FRAME_COMP_PSTRIDE(&frame_, 0) == 1) {
      luma = first_plane(CV_8UC1);
    } else {
      cv::extractChannel(first_plane(CV_8UC2), luma, GST_VIDEO_FRAME_COMP_POFFSET(&frame_, 0));
    }
    if (frame_.info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255) return luma;
    constexpr double kBlack = 16;  // ITU-R BT.601
    constexpr double kWhite = 235;
    constexpr double kScale = 255 / (kWhite - kBlack);
    cv::Mat grey;
    luma.convertTo(grey, CV_8U, kScale, -kBlack * kScale);
    return grey;
  }

  Sample sample_;
  GstVideoFrame frame_{};
  bool mapped_ = false;
};

/// A pipeline with one appsink.
class Pipeline final : public VideoStream {
 public:
  Pipeline(Element pipeline, Element sink)
      : pipeline_(std::move(pipeline)), sink_(std::move(sink)), bus_(gst_element_get_bus(pipeline_.get())) {}
  ~Pipeline() override { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Opens the device and begins.
  core::Status play() {
    if (gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING) != GST_STATE_CHANGE_FAILURE) return {};
    listen(milliseconds(0));
    return Error{problem_.empty() ? "it does not say why" : problem_};
  }

  Result<std::optional<Frame>> next(milliseconds patience) override {
    const auto until = std::chrono::steady_clock::now() + patience;
    while (true) {
      const auto left = std::chrono::duration_cast<milliseconds>(until - std::chrono::steady_clock::now());
      const auto wait = std::clamp(left, milliseconds(0), kStep);
      const Sample sample(gst_app_sink_try_pull_sample(app_sink(), gst_time(wait)), [](GstSample* one) {
        if (one != nullptr) gst_sample_unref(one);
      });
      if (sample) {
        auto frame = frame_of(sample);
        if (frame.pixels.empty()) return Error{"a picture cannot be read from GStreamer's memory"};
        return std::optional<Frame>(std::move(frame));
      }
      listen(started_ ? milliseconds(0) : wait);  // an appsink that is not yet connected does not wait
      if (!problem_.empty()) return Error{problem_};
      if (ended() || left <= milliseconds(0)) return std::optional<Frame>();
    }
  }
  [[nodiscard]] bool ended() const override { return gst_app_sink_is_eos(app_sink()) != FALSE && started_; }
  [[nodiscard]] bool playing() const override {
    GstState state = GST_STATE_NULL;
    return gst_element_get_state(pipeline_.get(), &state, nullptr, 0) == GST_STATE_CHANGE_SUCCESS &&
           state == GST_STATE_PLAYING;
  }
  [[nodiscard]] double rate_hz() const override { return rate_hz_; }

 private:
  [[nodiscard]] GstAppSink* app_sink() const { return GST_APP_SINK(sink_.get()); }
  Frame frame_of(const Sample& sample) {
    started_ = true;
    auto mapped = std::make_shared<MappedSample>(sample);
    rate_hz_ = mapped->rate_hz();
    const cv::Mat pixels = mapped->pixels();
    const auto at_ns = shown_at_ns(*sample);
    return {pixels, std::move(mapped), at_ns ? age_ns(*at_ns) : 0, at_ns};
  }
  /// Since the pipeline runs.
  [[nodiscard]] static std::optional<int64_t> shown_at_ns(GstSample& sample) {
    const GstClockTime stamp = GST_BUFFER_PTS(gst_sample_get_buffer(&sample));
    const GstSegment* const segment = gst_sample_get_segment(&sample);
    if (!GST_CLOCK_TIME_IS_VALID(stamp) || segment->format != GST_FORMAT_TIME) return std::nullopt;
    const GstClockTime shown = gst_segment_to_running_time(segment, GST_FORMAT_TIME, stamp);
    if (!GST_CLOCK_TIME_IS_VALID(shown)) return std::nullopt;
    return static_cast<int64_t>(shown);
  }
  /// Now less the time that the source has given the picture, both on the pipeline's clock.
  [[nodiscard]] int64_t age_ns(int64_t shown_at_ns) const {
    const Clock clock(gst_element_get_clock(pipeline_.get()));
    if (!clock) return 0;
    const GstClockTime now = gst_clock_get_time(clock.get()) - gst_element_get_base_time(pipeline_.get());
    return std::max<int64_t>(0, static_cast<int64_t>(now) - shown_at_ns);
  }
  /// What the elements have said: the first error counts, the rest follow from it.
  void listen(milliseconds patience) {
    constexpr auto kHeard = static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_ELEMENT | GST_MESSAGE_EOS);
    for (Message said(gst_bus_timed_pop_filtered(bus_.get(), gst_time(patience), kHeard)); said;
         said.reset(gst_bus_pop_filtered(bus_.get(), kHeard))) {
      if (gst_is_missing_plugin_message(said.get()) != FALSE) {
        missing_ = Text(gst_missing_plugin_message_get_description(said.get())).get();
      } else if (GST_MESSAGE_TYPE(said.get()) == GST_MESSAGE_EOS) {
        if (!started_) problem_ = "there is no picture in it";
      } else if (GST_MESSAGE_TYPE(said.get()) == GST_MESSAGE_ERROR && problem_.empty()) {
        problem_ = missing_.empty() ? error_text(said.get())
                                    : "GStreamer has no " + missing_ + " here; install gstreamer1.0-libav";
      }
    }
  }

  Element pipeline_;
  Element sink_;
  Bus bus_;
  bool started_ = false;  // there was a picture
  double rate_hz_ = 0;
  std::string missing_;  // what a plugin is missing for
  std::string problem_;
};

/// The one appsink of a pipeline.
Element sink_of(GstElement* pipeline) {
  if (!GST_IS_BIN(pipeline)) return nullptr;
  GstIterator* const all = gst_bin_iterate_all_by_element_factory_name(GST_BIN(pipeline), "appsink");
  GValue found = G_VALUE_INIT;
  Element sink;
  if (gst_iterator_next(all, &found) == GST_ITERATOR_OK) {
    sink.reset(GST_ELEMENT(g_value_dup_object(&found)));
    g_value_unset(&found);
  }
  gst_iterator_free(all);
  return sink;
}

struct Opened {
  Element pipeline;
  Element sink;
};
Result<Opened> prepare(const std::string& description, Colours colours) {
  auto parsed = parse_pipeline(description);
  if (!parsed.ok()) return parsed.error();
  Element pipeline = std::move(parsed).value();
  Element sink = sink_of(pipeline.get());
  if (!sink) return Error{"there is no appsink in it"};
  const Caps caps(gst_caps_from_string(colours == Colours::grey ? kForGrey : kForColours));
  gst_app_sink_set_caps(GST_APP_SINK(sink.get()), caps.get());
  return Opened{std::move(pipeline), std::move(sink)};
}

/// Only the newest picture waits; videos come at their own rate.
void keep_newest(GstElement* sink, bool at_its_rate) {
  g_object_set(sink, "max-buffers", 1U, "drop", TRUE, "sync", at_its_rate ? TRUE : FALSE, nullptr);
}

MaybeStream begin(Opened opened) {
  auto stream = std::make_unique<Pipeline>(std::move(opened.pipeline), std::move(opened.sink));
  if (auto status = stream->play(); !status.ok()) return status.error();
  return std::unique_ptr<VideoStream>(std::move(stream));
}

void set_where_known(GstElement* element, const char* property, const char* value) {
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), property) != nullptr)
    gst_util_set_object_arg(G_OBJECT(element), property, value);
}

/// RTSP over TCP, where nothing is lost that would be waited for; HTTP as a camera, whose data are stamped as they
/// come.
void set_up_network(GstElement* /*decoder*/, GstElement* source, gpointer /*data*/) {
  set_where_known(source, "latency", "100");
  set_where_known(source, "protocols", "tcp");
  if (GST_IS_BASE_SRC(source) == FALSE) return;
  set_where_known(source, "is-live", "true");
  set_where_known(source, "do-timestamp", "true");
}

/// A decoder that does not know that no other stream follows gathers seconds of pictures before it gives the first.
void set_up_part(GstBin* /*pipeline*/, GstBin* /*bin*/, GstElement* element, gpointer /*data*/) {
  set_where_known(element, "single-stream", "true");
}

void set_uri(const Opened& opened, const std::string& uri) {
  const Element source(gst_bin_get_by_name(GST_BIN(opened.pipeline.get()), "source"));
  g_object_set(source.get(), "uri", uri.c_str(), nullptr);
}

/// ", width=640, height=[ 1, 1200 ], framerate=[ ... ]" of what is asked.
std::string wanted(const DeviceOptions& options) {
  const auto exactly = [](int64_t asked, int64_t most) {
    return "=(int)" + (asked > 0 ? std::to_string(asked) : "[ 1, " + std::to_string(most) + " ]");
  };
  std::string text = ", width" + exactly(options.width_px, options.most_width_px) + ", height" +
                     exactly(options.height_px, options.most_height_px);
  if (options.rate_hz > 0) {
    // 30 also means 30000/1001.
    const auto milli_hz = [&](double factor) { return std::to_string(std::lround(options.rate_hz * factor * 1e3)); };
    text += ", framerate=(fraction)[ " + milli_hz(0.99) + "/1000, " + milli_hz(1.01) + "/1000 ]";
  }
  return text;
}

}  // namespace

MaybeStream open_file(const std::string& file, Pace pace, Colours colours) {
  auto opened = prepare(std::string(kFromUri) + kToPixels, colours);
  if (!opened.ok()) return opened.error();
  const Text uri(gst_filename_to_uri(file.c_str(), nullptr));
  if (!uri) return Error{"it has no name that GStreamer knows"};
  set_uri(opened.value(), uri.get());
  if (pace == Pace::real) {
    keep_newest(opened.value().sink.get(), true);
  } else {
    constexpr guint kDecodedAhead = 4;
    g_object_set(opened.value().sink.get(), "max-buffers", kDecodedAhead, "sync", FALSE, nullptr);
  }
  return begin(std::move(opened).value());
}

MaybeStream open_url(const std::string& url) {
  auto opened = prepare(std::string(kFromUri) + kToPixels, Colours::grey);
  if (!opened.ok()) return opened.error();
  set_uri(opened.value(), url);
  const Element source(gst_bin_get_by_name(GST_BIN(opened.value().pipeline.get()), "source"));
  g_signal_connect(source.get(), "source-setup", G_CALLBACK(set_up_network), nullptr);
  g_signal_connect(opened.value().pipeline.get(), "deep-element-added", G_CALLBACK(set_up_part), nullptr);
  keep_newest(opened.value().sink.get(), false);
  return begin(std::move(opened).value());
}

MaybeStream open_device(const std::string& device, const DeviceOptions& options) {
  auto opened =
      prepare(std::string("v4l2src name=source ! capsfilter name=asked ! decodebin") + kToPixels, Colours::grey);
  if (!opened.ok()) return opened.error();
  GstBin* const bin = GST_BIN(opened.value().pipeline.get());
  g_object_set(Element(gst_bin_get_by_name(bin, "source")).get(), "device", device.c_str(), nullptr);
  const Caps caps(gst_caps_from_string(
      ("video/x-raw" + wanted(options) + "; image/jpeg" + wanted(options) + "; video/x-h264" + wanted(options))
          .c_str()));
  g_object_set(Element(gst_bin_get_by_name(bin, "asked")).get(), "caps", caps.get(), nullptr);
  keep_newest(opened.value().sink.get(), false);
  return begin(std::move(opened).value());
}

MaybeStream open_pipeline(const std::string& description) {
  auto opened = prepare(description, Colours::grey);
  if (!opened.ok()) return opened.error();
  GstAppSink* const sink = GST_APP_SINK(opened.value().sink.get());
  if (gst_app_sink_get_max_buffers(sink) == 0) gst_app_sink_set_max_buffers(sink, 1);  // 0: as many as there is memory
  return begin(std::move(opened).value());
}

}  // namespace railfix::video
