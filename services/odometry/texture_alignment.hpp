// Sub-pixel alignment of two top views, patch by patch (paper 002, eq. 2-4, with gain and bias).
#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "odometry/ground_kind.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

/// What one patch of ground says about its own displacement.
struct PatchMotion {
  Eigen::Vector2d place_m;         // centre in the reference view: ahead, left
  Eigen::Vector2d displacement_m;  // place in the new view less place in the reference view
  Eigen::Matrix2d information;  // of the displacement, 1/m^2, from gradients and what the brightness leaves unexplained
  bool ballast = false;         // lies below the sleeper tops
  double correlation = 0;       // of the brightness after alignment
};

/// Displacement that is expected at a place of the reference view, on the sleepers or in the ballast.
using DisplacementField = std::function<Eigen::Vector2d(const Eigen::Vector2d& place_m, bool ballast)>;

/// The reference picture's patches: gradients and normal equations are computed once.
class TextureReference {
 public:
  struct Options {
    double patch_length_m = 0.75;
    int patches_across = 2;
    double noise_grey = 2.0;          // camera noise; gradients below it are not used
    double lowest_correlation = 0.4;  // patches below it do not vote
  };
  TextureReference(const vision::TopView& view, const vision::Sheet& sheet, const Options& options);

  /// One Gauss-Newton step of every patch from the expected displacement. Patches that leave the new view, have no
  /// texture, do not correlate or move by more than two cells are left out. Returns how many could be compared, those
  /// that do not correlate included.
  size_t measure(const vision::TopView& now, const DisplacementField& expected, std::vector<PatchMotion>& out) const;

 private:
  struct Pixel {
    int16_t row;
    int16_t col;
    float grey;  // less the patch's mean
    float along;
    float across;
  };
  struct Patch {
    Eigen::Vector2d place_m;
    std::vector<Pixel> pixels;
    bool ballast = false;
    Eigen::Matrix2d normal;  // sum of gradient products, per cell^2
    double energy = 0;       // sum of squared grey
  };
  struct Area {
    int row, rows, col, cols;
  };
  void add_patch(const vision::TopView& view, const std::vector<Ground>& ground, const Area& area, Ground kind);
  void finish(Patch& patch, double mean);
  enum class Answer { out_of_sight, differs, agrees };
  static Answer measure_patch(const Patch& patch, const vision::TopView& now, const vision::Sheet& sheet,
                              double lowest_correlation, const Eigen::Vector2d& expected_m, PatchMotion& out);

  vision::Sheet sheet_;
  Options options_;
  std::vector<Patch> patches_;
};

}  // namespace railfix::odometry
