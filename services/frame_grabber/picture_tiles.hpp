// Numbers of a picture, tile by tile, from some seventy of its rows: what picture_health decides on.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace railfix::frame_grabber {

constexpr int kTileColumns = 16;
constexpr int kTileRows = 12;
constexpr int kTiles = kTileColumns * kTileRows;
using TileMask = std::bitset<kTiles>;

/// Windows are 16 pixels of one row. Tiles are numbered row by row from the top left.
struct PictureTiles {
  struct Tile {
    float structure_grey = 0;  // deviation of the windows' means from a smooth course along the row
    float grey = 0;            // mean
    uint32_t windows = 0;
  };
  static constexpr int kSlopeBins = 32;
  std::array<Tile, kTiles> tiles{};
  /// Of windows with a height of at least 32 grey: how much of the height lies within two pixels, counted per tile.
  std::array<std::array<uint16_t, kSlopeBins>, kTiles> slopes{};
  std::array<uint32_t, 256> histogram{};  // every eighth pixel of these rows
  uint32_t pixels = 0;                    // in the histogram
  std::vector<uint8_t> window_means;      // row by row, columns of windows
  int window_columns = 0;

  /// REQUIRES: CV_8UC1, not empty. Reuses its memory.
  void measure(const cv::Mat& grey);
};

/// Mean difference of the windows' means, tile by tile. REQUIRES: of pictures of one size.
std::array<float, kTiles> difference(const PictureTiles& a, const PictureTiles& b);

/// A number that differs when any pixel differs (but for a chance of 2^-64).
uint64_t fingerprint(const cv::Mat& grey);

}  // namespace railfix::frame_grabber
