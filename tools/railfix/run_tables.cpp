#include "run_tables.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "core/csv.hpp"
#include "mcap/reader.hpp"
#include "messaging/message_words.hpp"
#include "messaging/samples.hpp"
#include "messaging/topics.hpp"
#include "track/map.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using core::CsvWriter;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr uint32_t kUnknownGroup = 16777215;  // NID_LRBG, SUBSET-026 7.5.1.90
constexpr size_t kShakeValues = 7;
// Diagonal of the upper triangle of a 7 x 7 matrix, row by row.
constexpr std::array<size_t, kShakeValues> kDiagonal{0, 7, 13, 18, 22, 25, 27};

template <size_t N>
const char* word(const std::array<const char*, N>& words, uint8_t value) {
  return value < N ? words[value] : "?";
}
constexpr std::array kFixes{"unknown", "curvature", "landmark", "network", "track", "gnss"};
constexpr std::array kDirections{"?", "+", "-"};
constexpr std::array kOrientations{"track", "imu"};

std::string sighted(uint8_t kind) {
  const auto landmark = static_cast<track::LandmarkKind>(kind);
  const bool possible = landmark == track::LandmarkKind::unknown || track::can_be_sighted(landmark);
  return possible ? to_string(landmark) : "?";
}

/// A name that may stand in a cell.
std::string cell(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return c == ',' || c == '\n' || c == '"'; }, '_');
  return text;
}

std::string hex(const msg::TrainPositionReport& report) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const uint8_t byte : messaging::bytes_of(report)) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

class Tables {
 public:
  explicit Tables(const fs::path& folder)
      : track_view_(
            folder / "track_view.csv",
            "stamp_ns,seen,roll_rad,pitch_rad,yaw_rad,lateral_m,height_m,curvature_per_m,vertical_curvature_per_m,"
            "roll_rad_sigma,pitch_rad_sigma,yaw_rad_sigma,lateral_m_sigma,height_m_sigma,curvature_per_m_sigma,"
            "vertical_curvature_per_m_sigma"),
        rails_(folder / "rails.csv", "stamp_ns,rail,u_px,v_px"),
        odometry_(folder / "odometry.csv",
                  "stamp_ns,valid,distance_m,speed_mps,lateral_speed_mps,yaw_rate_rps,step_sigma_m,mode"),
        sightings_(folder / "sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence"),
        position_fix_(folder / "position_fix.csv", "stamp_ns,kind,edge,offset_m,direction,sigma_m,probability"),
        train_state_(
            folder / "train_state.csv",
            "stamp_ns,edge,offset_m,direction,track_known,distance_m,speed_mps,over_m,under_m,sigma_m,integrity,"
            "lat_deg,lon_deg,easting_m,northing_m,heading_rad,track_probability"),
        train_pose_(folder / "train_pose.csv",
                    "stamp_ns,easting_m,northing_m,height_m,along_sigma_m,across_sigma_m,height_sigma_m,heading_rad,"
                    "pitch_rad,roll_rad,heading_sigma_rad,pitch_sigma_rad,roll_sigma_rad,orientation"),
        tpr_(folder / "tpr.csv",
             "stamp_ns,nid_lrbg,d_lrbg_m,q_dirlrbg,q_dlrbg,l_doubtover_m,l_doubtunder_m,v_train_kmh,q_dirtrain,hex"),
        status_(folder / "status.csv",
                "stamp_ns,service,host,state,frames_in,frames_out,dropped,latency_p50_ms,latency_p99_ms,cpu_percent,"
                "rss_mb") {}

  void add(const msg::TrackView& view) {
    seen_data(view.stamp_ns());
    const bool any = view.seen_left() != 0 || view.seen_right() != 0;
    track_view_ << view.stamp_ns() << (view.seen_left() != 0 && view.seen_right() != 0 ? 1 : 0);
    for (const double value : {view.roll_rad(), view.pitch_rad(), view.yaw_rad(), view.lateral_m(), view.height_m(),
                               view.curvature_per_m(), view.vertical_curvature_per_m()}) {
      track_view_ << (any ? value : kUnknown);
    }
    for (const size_t i : kDiagonal) {
      const double variance = view.covariance()[i];
      track_view_ << (any && variance > 0 ? std::sqrt(variance) : kUnknown);
    }
    end(track_view_);
    if (view.seen_left() != 0) rail(view.stamp_ns(), "L", view.left_u_px(), view.left_v_px(), view.left_points());
    if (view.seen_right() != 0) rail(view.stamp_ns(), "R", view.right_u_px(), view.right_v_px(), view.right_points());
  }

  void add(const msg::OdometryStep& step) {
    seen_data(step.stamp_ns());
    const bool known = messaging::has_measured(step);
    odometry_ << step.stamp_ns() << (step.valid() != 0 ? 1 : 0) << step.distance_m();
    for (const double value : {step.speed_mps(), step.lateral_speed_mps(), step.yaw_rate_rps(), step.step_sigma_m()}) {
      odometry_ << (known ? value : kUnknown);
    }
    odometry_ << word(messaging::kOdometryModeNames, step.mode());
    end(odometry_);
  }

  void add(const msg::LandmarkSighting& sighting) {
    seen_data(sighting.stamp_ns());
    sightings_ << sighting.stamp_ns() << sighted(sighting.kind()) << sighting.distance_ahead_m() << sighting.lateral_m()
               << sighting.sigma_m() << sighting.confidence();
    end(sightings_);
  }

  void add(const msg::PositionFix& fix) {
    seen_data(fix.stamp_ns());
    position_fix_ << fix.stamp_ns() << word(kFixes, fix.kind()) << fix.edge() << fix.offset_m()
                  << word(kDirections, fix.direction()) << fix.sigma_m() << fix.probability();
    end(position_fix_);
  }

  void add(const msg::TrainState& state) {
    seen_data(state.stamp_ns());
    train_state_ << state.stamp_ns();
    if (state.track_known() != 0) {
      train_state_ << state.edge() << state.offset_m() << word(kDirections, state.direction()) << 1;
    } else {
      train_state_.empty().empty().empty() << 0;
    }
    train_state_ << state.distance_m() << state.speed_mps() << state.over_m() << state.under_m() << state.sigma_m()
                 << word(messaging::kIntegrityNames, state.integrity());
    const bool placed = state.track_known() != 0;
    for (const double value :
         {state.lat_deg(), state.lon_deg(), state.easting_m(), state.northing_m(), state.heading_rad()}) {
      train_state_ << (placed ? value : kUnknown);
    }
    train_state_ << state.track_probability();
    end(train_state_);
  }

  void add(const msg::TrainPose& pose) {
    seen_data(pose.stamp_ns());
    train_pose_ << pose.stamp_ns();
    for (const double value :
         {pose.easting_m(), pose.northing_m(), pose.height_m(), pose.along_sigma_m(), pose.across_sigma_m(),
          pose.height_sigma_m(), pose.heading_rad(), pose.pitch_rad(), pose.roll_rad(), pose.heading_sigma_rad(),
          pose.pitch_sigma_rad(), pose.roll_sigma_rad()}) {
      train_pose_ << value;
    }
    train_pose_ << word(kOrientations, pose.orientation());
    end(train_pose_);
  }

  void add(const msg::TrainPositionReport& report) {
    seen_data(report.stamp_ns());
    tpr_ << report.stamp_ns();
    if (report.nid_lrbg() == kUnknownGroup) {
      tpr_.empty();
    } else {
      tpr_ << report.nid_lrbg();
    }
    tpr_ << report.d_lrbg_m() << int{report.q_dirlrbg()} << int{report.q_dlrbg()} << report.l_doubtover_m()
         << report.l_doubtunder_m() << report.v_train_kmh() << int{report.q_dirtrain()} << hex(report);
    end(tpr_);
  }

  void add(const msg::ServiceStatus& status) {
    status_ << (data_ns_ ? *data_ns_ : status.stamp_ns()) << cell(status.service().c_str())
            << cell(status.host().c_str()) << word(messaging::kStateNames, status.state()) << status.frames_in()
            << status.frames_out() << status.dropped() << status.latency_p50_ms() << status.latency_p99_ms()
            << status.cpu_percent() << status.rss_mb();
    end(status_);
  }

  /// The recording's data have a time of their own, which begins here.
  void begin_data(int64_t data_ns) { data_ns_ = data_ns; }
  [[nodiscard]] uint64_t rows() const { return rows_; }

  core::Status close() {
    for (CsvWriter* table : {&track_view_, &rails_, &odometry_, &sightings_, &position_fix_, &train_state_,
                             &train_pose_, &tpr_, &status_}) {
      auto status = table->close();
      if (!status.ok()) return status;
    }
    return {};
  }

 private:
  void end(CsvWriter& table) {
    table.end_row();
    ++rows_;
  }
  void seen_data(int64_t stamp_ns) {
    if (data_ns_) data_ns_ = std::max(*data_ns_, stamp_ns);
  }
  void rail(int64_t stamp_ns, const char* name, const std::array<float, 16>& u_px, const std::array<float, 16>& v_px,
            uint32_t points) {
    for (size_t i = 0; i < std::min<size_t>(points, u_px.size()); ++i) {
      rails_ << stamp_ns << name << double{u_px[i]} << double{v_px[i]};
      end(rails_);
    }
  }

  CsvWriter track_view_;
  CsvWriter rails_;
  CsvWriter odometry_;
  CsvWriter sightings_;
  CsvWriter position_fix_;
  CsvWriter train_state_;
  CsvWriter train_pose_;
  CsvWriter tpr_;
  CsvWriter status_;
  std::optional<int64_t> data_ns_;
  uint64_t rows_ = 0;
};

using AddSample = std::function<bool(Tables&, const std::vector<uint8_t>&)>;

template <class T>
std::pair<const std::string, AddSample> handler(const messaging::Topic<T>& topic) {
  return {topic.name, [](Tables& tables, const std::vector<uint8_t>& cdr) {
            T sample;
            if (!messaging::deserialize(cdr, sample)) return false;
            tables.add(sample);
            return true;
          }};
}

const std::map<std::string, AddSample>& handlers() {
  static const std::map<std::string, AddSample> all{handler(topics::track_view),
                                                    handler(topics::odometry_step),
                                                    handler(topics::landmark_sighting),
                                                    handler(topics::position_fix),
                                                    handler(topics::train_state),
                                                    handler(topics::train_pose),
                                                    handler(topics::train_position_report),
                                                    handler(topics::service_status)};
  return all;
}

/// Where the data's own time begins; nothing on a live train.
std::optional<int64_t> first_data_ns(mcap::Reader& reader) {
  std::optional<int64_t> first;
  reader.for_each({{topics::data_clock.name}, {}, {}}, [&](const mcap::Channel&, const mcap::Message& message) {
    msg::DataClock clock;
    if (messaging::deserialize({message.data.begin(), message.data.end()}, clock)) first = clock.data_ns();
    return !first;
  });
  return first;
}

void fill(mcap::Reader& reader, Tables& tables, TablesReport& report) {
  mcap::Selection selection;
  for (const auto& [topic, add] : handlers()) selection.topics.insert(topic);
  std::map<std::string, uint64_t> broken;
  reader.for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    const std::vector<uint8_t> cdr(message.data.begin(), message.data.end());
    if (!handlers().at(channel.topic)(tables, cdr)) ++broken[channel.topic];
    return true;
  });
  for (const auto& [topic, count] : broken) {
    report.problems.push_back(reader.file().string() + ": " + std::to_string(count) + " samples of " + topic +
                              " are not of this version's type and were left out");
  }
}

}  // namespace

core::Result<TablesReport> export_tables(const fs::path& recording, const fs::path& out_folder) {
  auto opened = mcap::Reader::open(recording);
  if (!opened.ok()) return opened.error();
  mcap::Reader& reader = *opened.value();
  std::error_code failed;
  fs::create_directories(out_folder, failed);
  if (failed) return core::Error{out_folder.string() + " cannot be made (" + failed.message() + ")"};
  TablesReport report;
  try {
    Tables tables(out_folder);
    if (const auto data_ns = first_data_ns(reader)) tables.begin_data(*data_ns);
    fill(reader, tables, report);
    const auto closed = tables.close();
    if (!closed.ok()) return closed.error();
    report.rows = tables.rows();
  } catch (const core::BadInput& error) {
    return core::Error{error.what()};
  }
  report.problems.insert(report.problems.end(), reader.problems().begin(), reader.problems().end());
  return report;
}

}  // namespace railfix::tool
