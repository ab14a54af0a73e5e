// What was really so: the truth tables of a dataset, at any time and any distance.
#pragma once

#include <filesystem>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/result.hpp"
#include "dataset/dataset.hpp"
#include "evaluation/time_gaps.hpp"

namespace railfix::evaluation {

/// What lies so far beside the true place lies on another track: neighbours are at least 3.5 m apart.
inline constexpr double kOwnTrackM = 2.0;

/// Of time, both ends included.
struct Stretch {
  int64_t from_ns = 0;
  int64_t to_ns = 0;
  [[nodiscard]] bool holds(int64_t stamp_ns) const { return stamp_ns >= from_ns && stamp_ns <= to_ns; }
};

class Truth {
 public:
  /// `folder` is SEQ/truth: track.csv, and when there are any landmarks.csv, visibility.csv and the camera's
  /// calibration of SEQ.
  static core::Result<Truth> read(const std::filesystem::path& folder);
  /// REQUIRES: at least two rows in the order of their stamps.
  Truth(std::vector<dataset::TruthRow> rows, std::optional<std::vector<dataset::TruthLandmark>> landmarks,
        std::optional<dataset::CameraCalibration> calibration);

  /// Linear between the two rows around the stamp; nothing outside the table and in its gaps.
  [[nodiscard]] std::optional<dataset::TruthRow> at(int64_t stamp_ns) const;

  struct Offset {
    double y_m = 0;
    double z_m = 0;
  };
  /// Where the track centre runs at each of these distances ahead (growing, > 0), against the track axes at the train:
  /// curvature and vertical curvature of the table integrated twice.
  [[nodiscard]] std::vector<Offset> track_ahead(const dataset::TruthRow& train,
                                                const std::vector<double>& ahead_m) const;

  /// Share of the own rails that the picture of this stamp shows; nothing when nobody says.
  [[nodiscard]] std::optional<double> rails_visible(int64_t stamp_ns) const;
  void set_visibility(const std::vector<dataset::TruthVisibility>& rows);

  [[nodiscard]] const std::vector<dataset::TruthRow>& rows() const { return rows_; }
  /// Rows in a row that lie further apart than a second and three times as far as usual: what was between them is not
  /// known.
  [[nodiscard]] TimeGaps gaps() const { return gaps_in(stamps_of(rows_)); }
  /// So far at most is the distance between two rows from the straight line between them, as the accelerations show.
  [[nodiscard]] double between_rows_m() const;
  [[nodiscard]] const std::optional<std::vector<dataset::TruthLandmark>>& landmarks() const { return landmarks_; }
  [[nodiscard]] const std::optional<dataset::CameraCalibration>& calibration() const { return calibration_; }
  [[nodiscard]] Stretch whole() const { return {rows_.front().stamp_ns, rows_.back().stamp_ns}; }
  /// Metres run, forward and back.
  [[nodiscard]] double travelled_m(const Stretch& stretch) const;

 private:
  struct Bend {
    double distance_m;
    double curvature_per_m;
    double vertical_per_m;
  };
  [[nodiscard]] Bend bend_at(double distance_m) const;
  [[nodiscard]] bool is_gap(int64_t from_ns, int64_t to_ns) const { return to_ns - from_ns > longest_step_ns_; }
  std::vector<dataset::TruthRow> rows_;
  int64_t longest_step_ns_ = 0;  // from row to row
  std::optional<std::vector<dataset::TruthLandmark>> landmarks_;
  std::optional<dataset::CameraCalibration> calibration_;
  std::unordered_map<int64_t, double> visible_;
  std::vector<Bend> bends_;  // by distance
};

}  // namespace railfix::evaluation
