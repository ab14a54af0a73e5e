#include "sensor_gateway/gpsd_reports.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/joined.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr size_t kLongestLine = 65536;  // gpsd's own limit is 10240
constexpr int64_t kQualityLastsNs = 10 * core::kNsPerSecond;
constexpr int64_t kSetBackNs = 10 * core::kNsPerSecond;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// "2026-11-23T01:42:00.250Z"
std::optional<int64_t> utc_ns_of(const std::string& text) {
  constexpr std::string_view kForm = "dddd-dd-ddTdd:dd:dd";
  if (text.size() <= kForm.size() || text.back() != 'Z') return std::nullopt;
  for (size_t i = 0; i < kForm.size(); ++i) {
    const bool fits = kForm[i] == 'd' ? text[i] >= '0' && text[i] <= '9' : text[i] == kForm[i];
    if (!fits) return std::nullopt;
  }
  const auto number = [&text](size_t from, size_t digits) {
    int value = 0;
    std::from_chars(text.data() + from, text.data() + from + digits, value);
    return value;
  };
  const std::chrono::year_month_day day{std::chrono::year(number(0, 4)),
                                        std::chrono::month(static_cast<unsigned>(number(5, 2))),
                                        std::chrono::day(static_cast<unsigned>(number(8, 2)))};
  if (!day.ok() || number(0, 4) < 1980 || number(0, 4) > 2200) return std::nullopt;
  double part_s = 0;
  const char* const end = text.data() + text.size() - 1;
  if (text[kForm.size()] == '.' && std::from_chars(text.data() + kForm.size(), end, part_s).ptr != end)
    return std::nullopt;
  if (text[kForm.size()] != '.' && text.size() != kForm.size() + 1) return std::nullopt;
  const int64_t seconds = number(11, 2) * 3600 + number(14, 2) * 60 + number(17, 2);
  return std::chrono::nanoseconds(std::chrono::sys_days(day).time_since_epoch()).count() +
         seconds * core::kNsPerSecond + core::to_ns(part_s);
}

constexpr int kMixed = 6;  // satellites and the receiver's own dead reckoning

// TPV's `status`. A place that dead reckoning is mixed into would count IMU and wheel twice. A place that is dead
// reckoned, surveyed or simulated is not measured by satellites.
int fix_of(int mode, int status) {
  if (mode < 2) return 0;
  switch (status) {
    case 3:
      return 4;  // RTK fixed
    case 4:
      return 5;  // RTK float
    case 5:      // dead reckoning
    case kMixed:
    case 7:  // surveyed
    case 8:  // simulated
      return 0;
    default:
      return 1;
  }
}

// Pulses and corrections are devices to gpsd, too.
bool is_receiver(const std::string& path) {
  return !path.empty() && !path.starts_with("/dev/pps") && !path.starts_with("ntrip://") &&
         !path.starts_with("dgpsip://");
}

}  // namespace

struct GpsdReports::Message {
  nlohmann::json json;

  [[nodiscard]] std::string text(const char* key) const {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : "";
  }
  [[nodiscard]] double number(const char* key) const {
    const auto found = json.find(key);
    return found != json.end() && found->is_number() ? found->get<double>() : kUnknown;
  }
  [[nodiscard]] int code(const char* key) const {
    const double value = number(key);
    return value >= 0 && value < 100 ? static_cast<int>(value) : 0;
  }
};

void GpsdReports::connected() {
  line_.clear();
  line_too_long_ = false;
  first_device_.clear();
  devices_.clear();
  trouble_.clear();
  lacks_quality_ = lacks_time_ = is_mixed_ = false;
}

std::vector<GpsdReport> GpsdReports::read(std::span<const uint8_t> bytes, int64_t arrival_ns) {
  std::vector<GpsdReport> reports;
  for (const uint8_t byte : bytes) {
    if (byte == '\n') {
      if (!line_too_long_) read_line(arrival_ns, reports);
      line_.clear();
      line_too_long_ = false;
    } else if (line_.size() < kLongestLine) {
      line_.push_back(static_cast<char>(byte));
    } else {
      line_too_long_ = true;
    }
  }
  return reports;
}

void GpsdReports::read_line(int64_t arrival_ns, std::vector<GpsdReport>& reports) {
  auto json = core::parse_json(line_);
  if (!json.ok() || !json.value().is_object()) return;
  const Message message{std::move(json).value()};
  const std::string kind = message.text("class");
  if (kind == "DEVICES") read_devices(message);
  if (!trouble_.empty() || !is_ours(message)) return;
  if (kind == "SKY") read_quality(message, arrival_ns);
  if (kind == "TPV") {
    if (auto report = read_position(message, arrival_ns)) reports.push_back(*report);
  }
}

void GpsdReports::read_devices(const Message& message) {
  const auto found = message.json.find("devices");
  if (found == message.json.end() || !found->is_array()) return;
  devices_.clear();
  for (const auto& device : *found) {
    if (!device.is_object()) continue;
    if (auto path = Message{device}.text("path"); is_receiver(path)) devices_.push_back(std::move(path));
  }
  trouble_.clear();
  if (device_.empty() && devices_.size() > 1)
    trouble_ = "has several receivers (" + core::joined(devices_) + "); name one behind the address";
  if (!device_.empty() && !devices_.empty() && std::find(devices_.begin(), devices_.end(), device_) == devices_.end())
    trouble_ =
        "has no receiver " + device_ + ", only " + core::joined(devices_) + "; correct the name behind the address";
}

bool GpsdReports::is_ours(const Message& message) {
  const std::string device = message.text("device");
  if (!device_.empty()) return device == device_;
  if (first_device_.empty() && message.text("class") == "TPV") first_device_ = device;
  return device == first_device_;
}

void GpsdReports::read_quality(const Message& message, int64_t arrival_ns) {
  const double hdop = message.number("hdop");
  if (std::isfinite(hdop) && hdop > 0) quality_ = Quality{hdop, arrival_ns, message.text("device")};
}

std::optional<GpsdReport> GpsdReports::read_position(const Message& message, int64_t arrival_ns) {
  GpsdReport report;
  report.utc_ns = utc_ns_of(message.text("time"));
  if (report.utc_ns && !is_news(*report.utc_ns)) return std::nullopt;
  auto& row = report.row;
  row = {0, kUnknown, kUnknown, kUnknown, kUnknown, fix_of(message.code("mode"), message.code("status"))};
  is_mixed_ = message.code("mode") >= 2 && message.code("status") == kMixed;
  if (row.fix == 0) return report;
  row.lat_deg = message.number("lat");
  row.lon_deg = message.number("lon");
  row.alt_m = message.number("altMSL");
  const bool on_earth = std::abs(row.lat_deg) <= 90 && std::abs(row.lon_deg) <= 180;
  lacks_time_ = on_earth && !report.utc_ns;
  if (!on_earth || lacks_time_) return std::nullopt;
  lacks_quality_ =
      !quality_ || quality_->device != message.text("device") || arrival_ns - quality_->arrival_ns > kQualityLastsNs;
  if (lacks_quality_) return std::nullopt;
  row.hdop = quality_->hdop;
  return report;
}

// One that is much older is the receiver's clock that was set.
bool GpsdReports::is_news(int64_t utc_ns) {
  if (last_utc_ns_ && utc_ns <= *last_utc_ns_ && *last_utc_ns_ - utc_ns < kSetBackNs) return false;
  last_utc_ns_ = utc_ns;
  return true;
}

std::string GpsdReports::complaint() const {
  if (!is_mixed_) return "";
  return "mixes its own dead reckoning into its positions (gpsd's status 6), so they are not used; switch the "
         "receiver's sensor fusion off (u-blox: CFG-SFCORE-USE_SF 0)";
}

std::string GpsdReports::why_silent() const {
  if (lacks_time_)
    return "tells positions without their time and date, which are not used; turn on the receiver's RMC or ZDA (or "
           "UBX-NAV-PVT) messages";
  if (lacks_quality_)
    return "tells positions without HDOP, which are not used; turn on the receiver's GSA and GSV (or "
           "UBX-NAV-DOP and UBX-NAV-SAT) messages";
  if (devices_.empty())
    return "has no receiver; check that it is plugged in, and tell gpsd of it with `gpsdctl add DEVICE`";
  return "tells no position; check the receiver " + (device_.empty() ? core::joined(devices_) : device_) +
         " and its cable";
}

}  // namespace railfix::sensor_gateway
