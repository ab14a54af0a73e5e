// A train's topics must be readable by any DDS that has our IDL: here Cyclone DDS, in a process of its own.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"

namespace railfix {
namespace {

constexpr int kDomain = 78;
constexpr int kStates = 20;
constexpr int kReports = 3;
constexpr int64_t kPatienceNs = 20 * core::kNsPerSecond;
constexpr int64_t kStatePeriodNs = 20'000'000;

std::string line_of(const char* pattern, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), pattern, value);
  return text.data();
}

/// As the reader program prints it.
class Line {
 public:
  explicit Line(const std::string& topic) { text_ << topic; }
  Line& operator<<(double value) {
    text_ << ' ' << line_of("%.17g", value);
    return *this;
  }
  Line& operator<<(uint8_t value) { return *this << uint64_t{value}; }
  Line& operator<<(uint32_t value) { return *this << uint64_t{value}; }
  Line& operator<<(uint64_t value) {
    text_ << ' ' << value;
    return *this;
  }
  Line& operator<<(int64_t value) {
    text_ << ' ' << value;
    return *this;
  }
  Line& operator<<(const std::string& value) {
    text_ << ' ' << value;
    return *this;
  }
  [[nodiscard]] std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

std::string line_of(const msg::TrainState& s) {
  Line line("train_state");
  line << s.stamp_ns() << s.grabbed_ns() << s.seq() << s.offset_m() << s.distance_m() << s.speed_mps()
       << s.acceleration_mps2() << s.over_m() << s.under_m() << s.sigma_m() << s.visual_scale() << s.wheel_scale()
       << s.since_reference_m() << s.lat_deg() << s.lon_deg() << s.easting_m() << s.northing_m() << s.heading_rad()
       << s.edge() << s.reference() << s.sources() << s.direction() << s.track_known() << s.integrity()
       << s.standstill();
  return line.text();
}

std::string line_of(const msg::TrainPositionReport& r) {
  std::string hex;
  for (size_t i = 0; i < r.message_bytes(); ++i) {
    std::array<char, 3> byte{};
    std::snprintf(byte.data(), byte.size(), "%02X", r.message()[i]);
    hex += byte.data();
  }
  Line line("train_position_report");
  line << r.stamp_ns() << r.sent_ns() << r.seq() << r.d_lrbg_m() << r.l_doubtover_m() << r.l_doubtunder_m()
       << r.v_train_kmh() << r.nid_engine() << r.nid_lrbg() << r.nid_prvlrbg() << r.message_bytes() << r.nid_packet()
       << r.q_dirlrbg() << r.q_dlrbg() << r.q_dirtrain() << r.baseline() << r.reason() << hex;
  return line.text();
}

msg::TrainState state_of(uint64_t seq) {
  const double x = static_cast<double>(seq);
  msg::TrainState s;
  s.stamp_ns(1'700'000'000'123'456'789 + static_cast<int64_t>(seq));
  s.grabbed_ns(s.stamp_ns() + 5);
  s.seq(seq);
  s.offset_m(100.1 + x);
  s.distance_m(-3.25 * x);
  s.speed_mps(27.7 + x / 7);
  s.acceleration_mps2(-0.3);
  s.over_m(4.5);
  s.under_m(std::numeric_limits<double>::infinity());
  s.sigma_m(1.1);
  s.visual_scale(1.001);
  s.wheel_scale(0.999);
  s.since_reference_m(812.5);
  s.lat_deg(std::numeric_limits<double>::quiet_NaN());
  s.lon_deg(8.54);
  s.easting_m(2680000.123);
  s.northing_m(1250000.456);
  s.heading_rad(1.57);
  s.edge(0xFEDCBA98);
  s.reference(77);
  s.sources(msg::SOURCE_CAMERA | msg::SOURCE_CURVATURE);
  s.direction(msg::DIRECTION_REVERSE);
  s.track_known(1);
  s.integrity(msg::INTEGRITY_DEGRADED);
  s.standstill(static_cast<uint8_t>(seq % 2));
  return s;
}

msg::TrainPositionReport report_of(uint64_t seq) {
  msg::TrainPositionReport r;
  r.stamp_ns(1'700'000'000'000'000'000 + static_cast<int64_t>(seq));
  r.sent_ns(r.stamp_ns() + 1);
  r.seq(seq);
  r.d_lrbg_m(1234);
  r.l_doubtover_m(10.5);
  r.l_doubtunder_m(67);
  r.v_train_kmh(140);
  r.nid_engine(0xABCD);
  r.nid_lrbg(2019799);
  r.nid_prvlrbg(16777215);
  r.nid_packet(1);
  r.q_dirlrbg(2);
  r.q_dlrbg(1);
  r.q_dirtrain(0);
  r.baseline(4);
  r.reason(msg::REPORT_BALISE_GROUP);
  r.message_bytes(64);
  for (size_t i = 0; i < 64; ++i) r.message()[i] = static_cast<uint8_t>(255 - i + seq);
  return r;
}

/// Third number of a line.
uint64_t seq_of(const std::string& line) {
  std::istringstream words(line);
  std::string topic;
  int64_t stamp_ns = 0;
  int64_t grabbed_ns = 0;
  uint64_t seq = 0;
  words >> topic >> stamp_ns >> grabbed_ns >> seq;
  return seq;
}

/// The reader program, its lines and how it ended.
class CycloneReader {
 public:
  explicit CycloneReader(const std::string& train) {
    std::ostringstream command;
    command << RAILFIX_BIN_DIR << "/railfix-cyclone-reader " << kDomain << " train/" << train << ' ' << kStates << ' '
            << kReports << ' ' << kPatienceNs / core::kNsPerSecond;
    pipe_ = popen(command.str().c_str(), "r");
    if (pipe_ == nullptr) return;
    thread_ = std::thread([this] {
      std::array<char, 2048> line{};
      while (std::fgets(line.data(), line.size(), pipe_) != nullptr) {
        lines_.emplace_back(line.data());
        lines_.back().pop_back();
      }
      ended_ = true;
    });
  }
  ~CycloneReader() {
    if (thread_.joinable()) finish();
  }
  CycloneReader(const CycloneReader&) = delete;
  CycloneReader& operator=(const CycloneReader&) = delete;
  [[nodiscard]] bool ended() const { return ended_; }
  int finish() {
    if (pipe_ == nullptr) return -1;
    thread_.join();
    return pclose(pipe_);
  }
  [[nodiscard]] const std::vector<std::string>& lines() const { return lines_; }

 private:
  FILE* pipe_ = nullptr;
  std::vector<std::string> lines_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

TEST(Cyclone, ReadsStatesAndReportsAsTheyWereWritten) {
  const auto options = test::network("cyclone-" + std::to_string(getpid()), kDomain);
  messaging::Participant participant(options);
  messaging::Queue queue;  // paces the writer
  messaging::Writer<msg::TrainPositionReport> reports(participant, messaging::topics::train_position_report);
  messaging::Writer<msg::TrainState> states(participant, messaging::topics::train_state);
  // Reports are transient local: those from before the reader came must reach it, too.
  for (uint64_t seq = 0; seq < kReports; ++seq) ASSERT_TRUE(reports.write(report_of(seq)));

  CycloneReader reader(options.train_id);
  const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
  for (uint64_t seq = 0; !reader.ended() && core::monotonic_ns() < deadline_ns; ++seq) {
    ASSERT_TRUE(states.write(state_of(seq)));
    queue.run_one(core::monotonic_ns() + kStatePeriodNs);
  }
  ASSERT_EQ(reader.finish(), 0) << "Cyclone DDS read " << reader.lines().size() << " samples before the time was up.";

  uint64_t reports_read = 0;
  std::optional<uint64_t> last_state;  // volatile: the first one is any
  for (const auto& line : reader.lines()) {
    if (line.starts_with("train_position_report ")) {
      EXPECT_EQ(line, line_of(report_of(reports_read++)));
      continue;
    }
    const uint64_t seq = seq_of(line);
    EXPECT_EQ(line, line_of(state_of(seq)));
    EXPECT_TRUE(!last_state || seq > *last_state);
    last_state = seq;
  }
  EXPECT_EQ(reports_read, kReports);
}

}  // namespace
}  // namespace railfix
