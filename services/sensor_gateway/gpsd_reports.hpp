// What gpsd says (gpsd_json(5)) -> positions. Bytes in, reports out; knows no connection and no clock.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dataset/dataset.hpp"

namespace railfix::sensor_gateway {

struct GpsdReport {
  std::optional<int64_t> utc_ns;  // of the position, by the receiver's clock
  dataset::GnssRow row;           // without stamp; fix 0 and no place where the receiver has none
};

class GpsdReports {
 public:
  /// `device`: the receiver by its name in gpsd; empty = the only one that gpsd has.
  explicit GpsdReports(std::string device) : device_(std::move(device)) {}

  /// What to tell gpsd first on every connection.
  static constexpr const char* kRequest = "?WATCH={\"enable\":true,\"json\":true};\n";
  void connected();
  /// Each position once, newer ones only. One whose quality (HDOP) is not known is none.
  [[nodiscard]] std::vector<GpsdReport> read(std::span<const uint8_t> bytes, int64_t arrival_ns);
  /// What is wrong with the receivers that gpsd has: nothing can be used until that is mended. Empty = nothing.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  /// What is wrong with the positions that come, behind the receiver's name. Empty = nothing.
  [[nodiscard]] std::string complaint() const;
  /// Why there may be no positions, for a technician.
  [[nodiscard]] std::string why_silent() const;

 private:
  struct Message;  // one line of JSON
  void read_line(int64_t arrival_ns, std::vector<GpsdReport>& reports);
  void read_devices(const Message& message);
  void read_quality(const Message& message, int64_t arrival_ns);
  std::optional<GpsdReport> read_position(const Message& message, int64_t arrival_ns);
  [[nodiscard]] bool is_ours(const Message& message);
  [[nodiscard]] bool is_news(int64_t utc_ns);

  std::string device_;
  std::string line_;
  bool line_too_long_ = false;
  std::string first_device_;  // that spoke on this connection, when none is named
  std::vector<std::string> devices_;
  std::string trouble_;
  struct Quality {
    double hdop;
    int64_t arrival_ns;
    std::string device;
  };
  std::optional<Quality> quality_;  // also of the connection before: some receivers tell it every few seconds only
  bool lacks_quality_ = false;
  bool lacks_time_ = false;
  bool is_mixed_ = false;
  std::optional<int64_t> last_utc_ns_;
};

}  // namespace railfix::sensor_gateway
