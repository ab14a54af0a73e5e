// How much a place between the rails looks like a balise rather than a stain, a puddle or a bar: the log of a
// likelihood ratio, from what sets a plate apart and with the blur that the picture has there.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "track_detector/landmark_types.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

struct CellBox {
  int row, col, rows, cols;
};

/// Mean and spread of any box of a CV_32F picture.
class AreaSums {
 public:
  void set(const cv::Mat& grey);
  [[nodiscard]] double mean(const CellBox& box) const { return of(sums_, box) / (box.rows * box.cols); }
  [[nodiscard]] double spread(const CellBox& box) const;

 private:
  [[nodiscard]] double of(const std::vector<double>& sums, const CellBox& box) const;
  size_t step_ = 0;
  std::vector<double> sums_, squared_;
};

/// What makes edges soft.
struct PlateBlur {
  double focal_px = 1000;
  double height_m = 2.5;  // of the camera over the plate
  double moved_m = 0;     // while the shutter was open

  /// Standard deviations on the ground, along and across the track.
  [[nodiscard]] double along_m(double ahead_m) const;
  [[nodiscard]] double across_m(double ahead_m) const;
};

/// A plate as it was measured in the sheet.
struct PlateSpot {
  double row, col;  // of its middle
  double ahead_m;
  double sharpness;  // share of the step that its softer long edge makes within kEdgeM
  double sign;       // +1 brighter than the ground
};

constexpr double kEdgeM = 0.03;        // a plate's edge is made within so much to either side ...
constexpr double kBesideEdgeM = 0.10;  // ... of what the brightness changes within this

class PlateEvidence {
 public:
  PlateEvidence(const vision::Sheet& sheet, const LandmarkOptions& options);

  /// Nothing where the plate's surroundings leave the sheet.
  std::optional<double> of(const AreaSums& sums, const PlateSpot& spot, const PlateBlur& blur);

 private:
  [[nodiscard]] double evenness(const AreaSums& sums, const PlateSpot& spot, const PlateBlur& blur) const;
  [[nodiscard]] double shape(double along_sigma_m, double across_sigma_m);
  bool take_patch(const AreaSums& sums, const PlateSpot& spot);
  [[nodiscard]] double rectangle_rest(double half_s_m, double half_d_m, double sigma_s_m, double sigma_d_m);
  [[nodiscard]] double ellipse_rest(double half_s_m, double half_d_m, double steepness) const;
  [[nodiscard]] double rest(double sum, double squares, double product) const;
  [[nodiscard]] double along_m(int row) const { return (row - 0.5 * (rows_ - 1)) * cell_m_; }
  [[nodiscard]] double across_m(int col) const { return (col - 0.5 * (cols_ - 1)) * cell_m_; }

  vision::Sheet sheet_;
  double half_length_m_, half_width_m_;
  double cell_m_;
  int rows_, cols_;             // of the patch around a plate
  std::vector<double> patch_;   // less its mean
  std::vector<double> across_;  // profile of a rectangle
  double squares_ = 0;
};

}  // namespace railfix::track_detector
