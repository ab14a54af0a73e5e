// Is this picture good enough to measure in? Reads the whole picture once for its fingerprint and some seventy rows
// for the rest.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

#include "frame_grabber/picture_tiles.hpp"
#include "geometry/camera.hpp"

namespace railfix::frame_grabber {

/// The bits have the values of PICTURE_* in idl/camera.idl.
enum HealthBit : uint32_t { kDark = 1, kSaturated = 2, kFrozen = 4, kOutOfOrder = 8, kCovered = 16, kBlurred = 32 };

struct PictureHealthConfig {
  double dark_below_grey = 16;        // 95 % of the pixels are darker
  double saturated_share = 0.4;       // of the pixels are 250 or brighter
  int64_t frozen_after_pictures = 1;  // so many repeats in a row: no camera is free of noise
  double covered_share = 0.5;         // of the tiles where the track is
  double blurred_below = 0.5;         // sharpness, see PictureHealth::sharpness()
  double persist_s = 2.0;             // covered and blurred must last so long
};

class PictureHealth {
 public:
  explicit PictureHealth(const PictureHealthConfig& config) : config_(config) {}

  /// Where the track is seen, so that sky and walls are not taken for a cover. Without it: the lower middle.
  void watch_track(const geometry::Intrinsics& camera, const geometry::CameraPose& mount);

  /// Bits of HealthBit, 0 = good. REQUIRES: CV_8UC1, not empty. Keeps nothing of the picture but numbers.
  uint32_t judge(int64_t stamp_ns, const cv::Mat& grey);

  /// Of the last picture: how much of an edge's height lies within two pixels, at the sharpest tenth of the edges in
  /// the track's part; 0.3 is a blur of 3 px. 0 where the edges are gone that were there a minute ago, though it is no
  /// darker; nothing where there are too few edges to tell.
  [[nodiscard]] std::optional<double> sharpness() const { return sharpness_; }
  /// Of the last picture: share of the track's tiles that show nothing, or stand still while others move.
  [[nodiscard]] double covered_share() const { return covered_share_; }

 private:
  /// True once a condition has held for persist_s.
  class Lasting {
   public:
    bool update(bool now, int64_t stamp_ns, int64_t long_enough_ns);

   private:
    std::optional<int64_t> since_ns_;
  };
  uint32_t exposure() const;
  bool repeated(int64_t stamp_ns, const cv::Mat& grey);
  bool seen_before(const cv::Mat& grey);
  bool shown_again(int64_t stamp_ns);
  void find_cover(int64_t stamp_ns);
  void compare_with_reference();
  void measure_sharpness();

  PictureHealthConfig config_;
  std::optional<TileMask> track_;
  PictureTiles now_;
  PictureTiles last_;  // the picture before
  std::optional<int64_t> last_ns_;
  int moves_ = 0;                          // pictures in a row that show motion, repeats left out
  double moved_ = 0;                       // change of the last one of them
  std::optional<int64_t> alike_since_ns_;  // the present row of repeats
  PictureTiles reference_;                 // of about a second ago
  std::optional<int64_t> reference_ns_;
  std::array<int, kTiles> still_{};  // times in a row that a tile stood still while the track moved
  std::array<uint64_t, 16> fingerprints_{};
  size_t pictures_ = 0;
  int64_t repeats_ = 0;
  std::optional<int64_t> newest_ns_;
  std::optional<double> sharpness_;
  double usual_edges_ = 0;  // running means over pictures with edges
  double usual_grey_ = 0;
  double covered_share_ = 0;
  Lasting covered_;
  Lasting blurred_;
};

}  // namespace railfix::frame_grabber
