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

/// The reference picture's patches: gradients and normal equations are computed once. Keeps its buffers.
class TextureReference {
 public:
  struct Options {
    double patch_length_m = 0.75;
    int patches_across = 2;
    double noise_grey = 2.0;          // camera noise; gradients below it are not used
    double lowest_correlation = 0.4;  // patches below it do not vote
  };
  explicit TextureReference(const Options& options) : options_(options) {}

  void set(const vision::TopView& view, const vision::Sheet& sheet);

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
  struct Sums {  // over the pixels: a = reference, b = new view, g = gradient of the reference
    float count = 0, a = 0, aa = 0, b = 0, bb = 0, ab = 0;
    float g[2] = {}, ga[2] = {}, gb[2] = {};
  };
  struct Patch {
    Eigen::Vector2d place_m;
    size_t begin = 0, end = 0;  // of its pixels
    int first_row = 0, last_row = 0, first_col = 0, last_col = 0;
    bool ballast = false;
    Eigen::Matrix2d normal;  // sum of gradient products, per cell^2
    double energy = 0;       // sum of squared grey
    Sums whole;              // of the reference alone, over all its pixels
  };
  struct Area {
    int row, rows, col, cols;
  };
  struct Shift {  // whole cells, and the weights of the four cells around
    int row, col;
    float w00, w01, w10, w11;
  };
  enum class Answer { out_of_sight, differs, agrees };

  void add_patch(const vision::TopView& view, const Area& area, Ground kind);
  void finish(Patch& patch, double mean);
  [[nodiscard]] static Shift split(const Eigen::Vector2d& cells);
  [[nodiscard]] bool inside(const Patch& patch, const vision::TopView& now, const Shift& shift) const;
  [[nodiscard]] Sums compare_whole(const Patch& patch, const vision::TopView& now, const Shift& shift) const;
  [[nodiscard]] Sums compare_part(const Patch& patch, const vision::TopView& now, const Shift& shift) const;
  Answer measure_patch(const Patch& patch, const vision::TopView& now, const Eigen::Vector2d& expected_m,
                       PatchMotion& out) const;
  Answer step(const Patch& patch, const Sums& sums, const Eigen::Vector2d& expected_m, PatchMotion& out) const;

  Options options_;
  vision::Sheet sheet_;
  GroundFinder ground_finder_;
  std::vector<Ground> ground_;
  std::vector<Pixel> pixels_;
  std::vector<Patch> patches_;
};

}  // namespace railfix::odometry
