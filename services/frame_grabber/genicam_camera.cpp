// GigE Vision and USB3 Vision cameras through Aravis.
#include <arv.h>

#include <cmath>
#include <utility>

#include "core/device_clock.hpp"
#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {
namespace {

using core::Error;
using core::Result;

constexpr int kBuffers = 12;
constexpr int64_t kExposurePeriodNs = core::kNsPerSecond;
constexpr uint64_t kCutByChance = 2;    // pictures in a row; a cable that is pulled out cuts one, too
constexpr uint64_t kLargestGap = 1000;  // pictures; more is a camera that began to count anew
constexpr uint64_t kIds16 = 0xFFFF;     // 65535 is followed by 1

/// One reference to a GObject.
template <class T>
using Held = std::shared_ptr<T>;
template <class T>
Held<T> hold(T* object) {
  return Held<T>(object, [](T* one) {
    if (one != nullptr) g_object_unref(one);
  });
}

/// What Aravis says of a call. Collects the first error of several calls.
class Said {
 public:
  operator GError**() { return &error_; }  // NOLINT(google-explicit-constructor): the argument of every call
  Said() = default;
  Said(const Said&) = delete;
  Said& operator=(const Said&) = delete;
  ~Said() { g_clear_error(&error_); }
  [[nodiscard]] bool failed() const { return error_ != nullptr; }
  [[nodiscard]] std::string text() const { return error_ == nullptr ? "" : error_->message; }
  [[nodiscard]] bool in_use() const { return text().find("access") != std::string::npos; }

 private:
  GError* error_ = nullptr;
};

class GenicamCamera final : public LiveCamera {
 public:
  GenicamCamera(std::string id, const LiveConfig& config) : id_(std::move(id)), config_(config) {}
  ~GenicamCamera() override { disconnect(); }
  GenicamCamera(const GenicamCamera&) = delete;
  GenicamCamera& operator=(const GenicamCamera&) = delete;

  Result<std::string> connect() override;
  Result<std::optional<RawPicture>> next(std::chrono::milliseconds patience) override;
  void disconnect() override;
  uint64_t take_lost() override { return std::exchange(lost_, 0); }
  [[nodiscard]] std::string name() const override { return "camera genicam:" + (id_.empty() ? "any" : id_); }
  [[nodiscard]] std::string why_silent() const override;

 private:
  /// Sets one thing and says what could not be set.
  template <class Call>
  core::Status set(const std::string& what, Call call) {
    Said said;
    call(said);
    if (!said.failed()) return {};
    return Error{name() + " does not take " + what + ": " + said.text()};
  }
  core::Status configure();
  core::Status configure_light();
  core::Status configure_rate();
  bool enable_ptp();
  core::Status start();
  void read_exposure();
  void note_nothing_came();
  void note_incomplete(ArvBuffer* buffer);
  RawPicture picture_of(ArvBuffer* buffer);
  int64_t mid_exposure_ns(ArvBuffer* buffer, bool host_time);
  [[nodiscard]] bool shows_host_time(ArvBuffer* buffer) const;
  void count_lost_before(uint64_t frame_id);

  std::string id_;
  LiveConfig config_;
  Held<ArvCamera> camera_;
  Held<ArvStream> stream_;
  core::DeviceClock clock_;
  std::optional<uint64_t> last_id_;
  uint64_t lost_ = 0;        // pictures, not yet told
  uint64_t incomplete_ = 0;  // since the last whole one
  int64_t came_ns_ = 0;      // the last picture, whole or not; monotonic
  float exposure_s_ = 0;
  int64_t exposure_read_ns_ = 0;
  bool has_ptp_ = false;
};

Result<std::string> GenicamCamera::connect() {
  Said said;
  arv_update_device_list();
  camera_ = hold(arv_camera_new(id_.empty() ? nullptr : id_.c_str(), said));
  if (!camera_) {
    if (said.in_use()) return Error{name() + " is used by another program; end that one, or wait until it lets go"};
    return Error{name() +
                 " is not found on any network or USB port; check cable, power and its address with "
                 "`arv-tool-0.8`"};
  }
  for (const auto& status : {configure(), configure_light(), configure_rate(), start()}) {
    if (status.ok()) continue;
    disconnect();
    return status.error();
  }
  const auto text = [](const char* word) { return std::string(word == nullptr ? "?" : word); };
  return name() + " is a " + text(arv_camera_get_vendor_name(camera_.get(), nullptr)) + " " +
         text(arv_camera_get_model_name(camera_.get(), nullptr)) + ", " +
         text(arv_camera_get_pixel_format_as_string(camera_.get(), nullptr)) + (has_ptp_ ? ", its PTP is on" : "");
}

core::Status GenicamCamera::configure() {
  ArvCamera* camera = camera_.get();
  if (!pixel_format(config_.pixel_format)) {
    return Error{"pixel_format '" + config_.pixel_format + "' is not read; give one of " + pixel_format_names()};
  }
  auto status = set("pixel_format " + config_.pixel_format, [&](GError** error) {
    arv_camera_set_pixel_format_from_string(camera, config_.pixel_format.c_str(), error);
  });
  if (!status.ok()) return status;
  if (config_.width_px > 0 || config_.height_px > 0) {  // 0 leaves that one as it is
    const auto side = [](int64_t px) { return px > 0 ? std::to_string(px) : "any"; };
    status = set("a region of " + side(config_.width_px) + "x" + side(config_.height_px), [&](GError** error) {
      arv_camera_set_region(camera, -1, -1, static_cast<int>(config_.width_px), static_cast<int>(config_.height_px),
                            error);
    });
    if (!status.ok()) return status;
  }
  if (arv_camera_is_gv_device(camera) && config_.packet_size > 0) {
    arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    status = set("packets of " + std::to_string(config_.packet_size) + " bytes", [&](GError** error) {
      arv_camera_gv_set_packet_size(camera, static_cast<int>(config_.packet_size), error);
    });
  }
  has_ptp_ = config_.ptp && enable_ptp();
  return status;
}

core::Status GenicamCamera::configure_light() {
  ArvCamera* camera = camera_.get();
  if (arv_camera_is_exposure_auto_available(camera, nullptr)) {
    arv_camera_set_exposure_time_auto(camera, config_.exposure_us > 0 ? ARV_AUTO_OFF : ARV_AUTO_CONTINUOUS, nullptr);
  }
  if (config_.exposure_us > 0) {
    const auto status = set("an exposure of " + std::to_string(std::lround(config_.exposure_us)) + " us",
                            [&](GError** error) { arv_camera_set_exposure_time(camera, config_.exposure_us, error); });
    if (!status.ok()) return status;
  }
  if (arv_camera_is_gain_auto_available(camera, nullptr)) {
    arv_camera_set_gain_auto(camera, config_.gain_db >= 0 ? ARV_AUTO_OFF : ARV_AUTO_CONTINUOUS, nullptr);
  }
  if (config_.gain_db < 0) return {};
  return set("a gain of " + std::to_string(std::lround(config_.gain_db)) + " dB",
             [&](GError** error) { arv_camera_set_gain(camera, config_.gain_db, error); });
}

core::Status GenicamCamera::configure_rate() {
  ArvCamera* camera = camera_.get();
  arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, nullptr);
  if (!config_.trigger.empty()) {
    return set("the trigger " + config_.trigger,
               [&](GError** error) { arv_camera_set_trigger(camera, config_.trigger.c_str(), error); });
  }
  arv_camera_clear_triggers(camera, nullptr);
  if (config_.rate_hz <= 0) return {};
  return set("a rate of " + std::to_string(std::lround(config_.rate_hz)) + " Hz",
             [&](GError** error) { arv_camera_set_frame_rate(camera, config_.rate_hz, error); });
}

/// The name of the switch before and since SFNC 2.3. True when the camera has one of them.
bool GenicamCamera::enable_ptp() {
  for (const char* feature : {"PtpEnable", "GevIEEE1588"}) {
    if (!arv_camera_is_feature_available(camera_.get(), feature, nullptr)) continue;
    Said said;
    arv_camera_set_boolean(camera_.get(), feature, TRUE, said);
    return !said.failed();
  }
  return false;
}

core::Status GenicamCamera::start() {
  Said said;
  stream_ = hold(arv_camera_create_stream(camera_.get(), nullptr, nullptr, said));
  if (!stream_) return Error{name() + " cannot send pictures: " + said.text()};
  const size_t payload = arv_camera_get_payload(camera_.get(), said);
  for (int i = 0; i < kBuffers; ++i) arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload, nullptr));
  read_exposure();
  clock_ = core::DeviceClock();
  last_id_.reset();
  incomplete_ = 0;
  arv_camera_start_acquisition(camera_.get(), said);
  if (said.failed()) return Error{name() + " does not start: " + said.text()};
  return {};
}

// Where it cannot be read it is taken to be as it was: 0 would move every stamp by half of it.
void GenicamCamera::read_exposure() {
  Said said;
  const double exposure_us = arv_camera_get_exposure_time(camera_.get(), said);
  exposure_read_ns_ = core::monotonic_ns();
  if (said.failed()) return;
  exposure_s_ = static_cast<float>(exposure_us > 0 ? exposure_us * 1e-6 : 0);
}

Result<std::optional<RawPicture>> GenicamCamera::next(std::chrono::milliseconds patience) {
  const auto patience_us = std::chrono::duration_cast<std::chrono::microseconds>(patience).count();
  ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream_.get(), static_cast<uint64_t>(patience_us));
  if (buffer == nullptr) {
    note_nothing_came();
    return std::optional<RawPicture>();
  }
  came_ns_ = core::monotonic_ns();
  if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS) {
    note_incomplete(buffer);
    return std::optional<RawPicture>();
  }
  incomplete_ = 0;
  RawPicture picture = picture_of(buffer);
  if (picture.bytes == nullptr) return Error{name() + " sends broken pictures; set pixel_format and packet_size anew"};
  // An automatic one changes by a factor of ten where a tunnel begins. A camera that is away is not asked: it would be
  // waited for. After the picture has its stamp, so that the answer's way delays none.
  if (config_.exposure_us <= 0 && core::monotonic_ns() - exposure_read_ns_ >= kExposurePeriodNs) read_exposure();
  return std::optional<RawPicture>(std::move(picture));
}

// What was cut before is not why nothing comes at all. Half, as silence is told live.silent_s behind the last whole
// one.
void GenicamCamera::note_nothing_came() {
  if (core::seconds(core::monotonic_ns() - came_ns_) > config_.silent_s / 2) incomplete_ = 0;
}

void GenicamCamera::note_incomplete(ArvBuffer* buffer) {
  count_lost_before(arv_buffer_get_frame_id(buffer));
  ++lost_;
  ++incomplete_;
  arv_stream_push_buffer(stream_.get(), buffer);
}

RawPicture GenicamCamera::picture_of(ArvBuffer* buffer) {
  RawPicture picture;
  picture.keep = std::shared_ptr<const void>(buffer, [stream = stream_](const void* one) {
    arv_stream_push_buffer(stream.get(), static_cast<ArvBuffer*>(const_cast<void*>(one)));  // NOLINT
  });
  size_t bytes = 0;
  const void* data = arv_buffer_get_data(buffer, &bytes);
  picture.size = {arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer)};
  picture.format = *pixel_format(config_.pixel_format);
  picture.row_bytes = bytes_of_row(picture.format, picture.size.width);
  const auto rows = static_cast<size_t>(picture.size.height);
  if (data != nullptr && picture.size.area() > 0 && bytes >= picture.row_bytes * rows) {
    picture.bytes = static_cast<const uint8_t*>(data);
  }
  picture.exposure_s = exposure_s_;
  const bool host_time = shows_host_time(buffer);
  picture.stamp_ns = mid_exposure_ns(buffer, host_time);
  picture.no_host_time = config_.ptp && !host_time;
  count_lost_before(arv_buffer_get_frame_id(buffer));
  picture.lost = take_lost();
  if (ARV_IS_GV_STREAM(stream_.get())) {
    arv_gv_stream_get_statistics(ARV_GV_STREAM(stream_.get()), nullptr, &picture.bad_packets);
  }
  return picture;
}

/// With PTP the camera's time is the begin of exposure; else the first packet leaves at its end.
int64_t GenicamCamera::mid_exposure_ns(ArvBuffer* buffer, bool host_time) {
  const auto camera_ns = static_cast<int64_t>(arv_buffer_get_timestamp(buffer));
  const auto arrival_ns = static_cast<int64_t>(arv_buffer_get_system_timestamp(buffer));
  const int64_t half_ns = core::to_ns(exposure_s_ / 2);
  if (host_time) return camera_ns + half_ns;
  const core::HostTime now = core::host_time();
  const int64_t waited_ns =
      std::clamp<int64_t>(now.wall_ns - arrival_ns, 0, core::kNsPerSecond);  // the clock may be set
  return clock_.host_ns(camera_ns, {now.wall_ns - waited_ns, now.monotonic_ns - waited_ns}) - half_ns -
         core::to_ns(config_.latency_ms * 1e-3);
}

/// By PTP; not while it is not locked, nor of a master that gives another time, as TAI.
bool GenicamCamera::shows_host_time(ArvBuffer* buffer) const {
  const auto camera_ns = static_cast<int64_t>(arv_buffer_get_timestamp(buffer));
  const auto arrival_ns = static_cast<int64_t>(arv_buffer_get_system_timestamp(buffer));
  return has_ptp_ && std::abs(camera_ns - arrival_ns) < core::kNsPerSecond;
}

std::string GenicamCamera::why_silent() const {
  if (incomplete_ <= kCutByChance) return "";
  return "sends only incomplete pictures (" + std::to_string(incomplete_) +
         "); check live.packet_size against the network card's MTU, and the cable";
}

void GenicamCamera::count_lost_before(uint64_t frame_id) {
  uint64_t gap = 1;
  if (last_id_) {
    const bool wrapped = frame_id < *last_id_ && *last_id_ <= kIds16;
    gap = (wrapped ? frame_id + kIds16 : frame_id) - *last_id_;
  }
  last_id_ = frame_id;
  if (gap > 0 && gap < kLargestGap) lost_ += gap - 1;
}

void GenicamCamera::disconnect() {
  if (stream_) arv_stream_set_emit_signals(stream_.get(), FALSE);
  if (camera_) arv_camera_stop_acquisition(camera_.get(), nullptr);
  stream_.reset();
  camera_.reset();
}

}  // namespace

std::unique_ptr<LiveCamera> make_genicam_camera(const std::string& id, const LiveConfig& config) {
  return std::make_unique<GenicamCamera>(id, config);
}

}  // namespace railfix::frame_grabber
