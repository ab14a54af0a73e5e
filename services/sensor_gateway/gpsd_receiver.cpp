// A GNSS receiver behind gpsd, over its TCP port.
#include <spdlog/fmt/fmt.h>

#include <array>
#include <cmath>

#include "core/kernel_clock.hpp"
#include "core/time.hpp"
#include "sensor_gateway/byte_line.hpp"
#include "sensor_gateway/gnss_clock.hpp"
#include "sensor_gateway/gpsd_reports.hpp"
#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::string_view kScheme = "gpsd://";

struct Place {
  Address address;
  std::string device;
};

core::Result<Place> place_of(const std::string& source) {
  const core::Error wrong{
      "'" + source +
      "' is no GNSS receiver; give gpsd://ADDRESS:PORT, as gpsd://127.0.0.1:2947, or behind it one of several "
      "receivers, as gpsd://127.0.0.1:2947/dev/ttyACM0"};
  if (!source.starts_with(kScheme)) return wrong;
  const std::string rest = source.substr(kScheme.size());
  const std::string peer = rest.substr(0, rest.find('/'));
  const auto colon = peer.rfind(':');
  if (colon == std::string::npos) return wrong;
  Place place{{peer.substr(0, colon), peer.substr(colon + 1)}, rest.substr(peer.size())};
  if (place.address.ip == "localhost") place.address.ip = "127.0.0.1";
  if (place.address.ip.starts_with('[') && place.address.ip.ends_with(']'))
    place.address.ip = place.address.ip.substr(1, place.address.ip.size() - 2);
  if (!is_address(place.address)) return wrong;
  return place;
}

class GpsdReceiver final : public LiveSensor {
 public:
  GpsdReceiver(std::string source, Place place, const LiveConfig& config)
      : source_(std::move(source)),
        place_(std::move(place)),
        reports_(place_.device),
        clock_(core::to_ns(config.gnss_latency_ms * 1e-3)),
        latency_ns_(core::to_ns(config.gnss_latency_ms * 1e-3)) {}

  core::Result<std::string> connect() override {
    reports_.connected();
    clock_.connected();
    auto status = line_.connect(place_.address);
    if (status.ok()) status = line_.write(GpsdReports::kRequest);
    if (status.ok()) return name() + " is connected";
    return core::Error{name() + " cannot be reached (" + status.error().message +
                       "); check that gpsd runs there (`gpspipe -w`), it is tried again"};
  }

  core::Result<Delivery> next(std::chrono::milliseconds patience) override {
    const auto got = line_.read(bytes_, patience);
    if (!got.ok()) {
      return core::Error{name() + " has closed the connection (" + got.error().message +
                         "); check gpsd, it is tried again"};
    }
    const core::HostTime arrival = core::host_time();
    std::vector<Sample> samples;
    for (const auto& report : reports_.read(std::span(bytes_).first(got.value()), arrival.monotonic_ns)) {
      if (const auto stamp_ns = stamp_of(report, arrival)) {
        samples.emplace_back(report.row);
        std::get<dataset::GnssRow>(samples.back()).stamp_ns = *stamp_ns;
      }
    }
    if (!reports_.trouble().empty()) return core::Error{name() + " " + reports_.trouble()};
    if (const auto ahead_s = clock_.contradiction_s()) return core::Error{contradiction(*ahead_s)};
    const std::string complaint = reports_.complaint();
    return Delivery{std::move(samples), {}, complaint.empty() ? "" : name() + " " + complaint};
  }

  void disconnect() override { line_.close(); }
  void cancel() override { line_.cancel(); }
  [[nodiscard]] const std::string& source() const override { return source_; }
  [[nodiscard]] std::string name() const override { return "GNSS receiver " + source_; }
  [[nodiscard]] std::string why_silent() const override { return reports_.why_silent(); }

 private:
  /// A receiver that has not yet heard of the time can still tell that it has no position.
  std::optional<int64_t> stamp_of(const GpsdReport& report, const core::HostTime& arrival) {
    if (!report.utc_ns) return arrival.wall_ns - latency_ns_;
    return clock_.stamp_ns(*report.utc_ns, arrival, core::is_kept(core::clock_error_ns()));
  }
  [[nodiscard]] std::string contradiction(double ahead_s) const {
    return fmt::format(
        "{}: this computer's clock is {:.1f} s {} the receiver's time, so its positions are not used; see which of the "
        "two is right (`chronyc tracking`, `gpspipe -w`)",
        name(), std::abs(ahead_s), ahead_s > 0 ? "ahead of" : "behind");
  }

  std::string source_;
  Place place_;
  ByteLine line_;
  GpsdReports reports_;
  GnssClock clock_;
  int64_t latency_ns_;
  std::array<uint8_t, 4096> bytes_{};
};

}  // namespace

core::Result<std::unique_ptr<LiveSensor>> make_gpsd_receiver(const std::string& source, const LiveConfig& config) {
  auto place = place_of(source);
  if (!place.ok()) return place.error();
  return std::unique_ptr<LiveSensor>(std::make_unique<GpsdReceiver>(source, std::move(place).value(), config));
}

}  // namespace railfix::sensor_gateway
