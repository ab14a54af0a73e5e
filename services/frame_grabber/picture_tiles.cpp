#include "frame_grabber/picture_tiles.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

namespace railfix::frame_grabber {
namespace {

constexpr int kRows = 72;  // that are read of a picture, about
constexpr int kColumnStep = 8;
constexpr int kWindow = 16;  // pixels
constexpr int kEdgeGrey = 32;
constexpr float kSecondDifference = 2.449F;  // sigma of a - 2b + c over sigma of a

struct Window {
  int mean = 0;
  int height = 0;
  int steepest = 0;  // within two pixels
};

/// REQUIRES: 18 pixels.
Window look_at(const uint8_t* p) {
  const cv::v_uint8x16 here = cv::v_load(p);
  const int height = cv::v_reduce_max(here) - cv::v_reduce_min(here);
  const int steepest = cv::v_reduce_max(cv::v_absdiff(here, cv::v_load(p + 2)));
  return {static_cast<int>(cv::v_reduce_sum(here)) / kWindow, height, std::min(steepest, height)};
}

int tile_of(int position, int length, int tiles) {
  return std::min(position * tiles / length, tiles - 1);
}

}  // namespace

void PictureTiles::measure(const cv::Mat& grey) {
  tiles = {};
  slopes = {};
  histogram = {};
  pixels = 0;
  window_columns = std::max(0, (grey.cols - 2) / kWindow);
  const int step = std::clamp(grey.rows / kRows, 1, 16);
  window_means.clear();
  for (int row = step / 2; row < grey.rows; row += step) {
    const uint8_t* values = grey.ptr(row);
    for (int column = 0; column < grey.cols; column += kColumnStep, ++pixels) ++histogram[values[column]];
    const int tile_row = tile_of(row, grey.rows, kTileRows) * kTileColumns;
    int before = -1;
    int last = -1;
    for (int w = 0; w < window_columns; ++w) {
      const Window window = look_at(values + w * kWindow);
      window_means.push_back(static_cast<uint8_t>(window.mean));
      const auto index = static_cast<size_t>(tile_row + tile_of(w, window_columns, kTileColumns));
      Tile& tile = tiles[index];
      ++tile.windows;
      tile.grey += static_cast<float>(window.mean);
      if (before >= 0) tile.structure_grey += static_cast<float>(std::abs(window.mean - 2 * last + before));
      if (window.height >= kEdgeGrey) ++slopes[index][window.steepest * (kSlopeBins - 1) / window.height];
      before = last;
      last = window.mean;
    }
  }
  for (Tile& tile : tiles) {
    if (tile.windows == 0) continue;
    const auto count = static_cast<float>(tile.windows);
    tile.grey /= count;
    tile.structure_grey *= 1.25F / (kSecondDifference * count);
  }
}

std::array<float, kTiles> difference(const PictureTiles& a, const PictureTiles& b) {
  std::array<float, kTiles> sums{};
  const int rows = a.window_columns == 0 ? 0 : static_cast<int>(a.window_means.size()) / a.window_columns;
  size_t at = 0;
  for (int row = 0; row < rows; ++row) {
    const int tile_row = tile_of(row, rows, kTileRows) * kTileColumns;
    for (int w = 0; w < a.window_columns; ++w, ++at) {
      const auto index = static_cast<size_t>(tile_row + tile_of(w, a.window_columns, kTileColumns));
      sums[index] += static_cast<float>(std::abs(a.window_means[at] - b.window_means[at]));
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) sums[i] /= static_cast<float>(std::max(1U, a.tiles[i].windows));
  return sums;
}

uint64_t fingerprint(const cv::Mat& grey) {
  constexpr uint64_t kOdd = 0x9E3779B97F4A7C15ULL;
  constexpr size_t kLanes = 8;  // so many multiplications are under way at a time
  uint64_t lanes[kLanes] = {1, 2, 3, 4, 5, 6, 7, 8};
  const auto columns = static_cast<size_t>(grey.cols);
  for (int row = 0; row < grey.rows; ++row) {
    const uint8_t* p = grey.ptr(row);
    size_t i = 0;
    for (; i + 8 * kLanes <= columns; i += 8 * kLanes) {
      uint64_t words[kLanes];
      std::memcpy(words, p + i, sizeof words);
      for (size_t k = 0; k < kLanes; ++k) lanes[k] = (std::rotl(lanes[k], 23) ^ words[k]) * kOdd;
    }
    for (; i < columns; ++i) lanes[i % kLanes] = (std::rotl(lanes[i % kLanes], 23) ^ p[i]) * kOdd;
  }
  uint64_t all = static_cast<uint64_t>(grey.rows) * kOdd + columns;
  for (const uint64_t lane : lanes) all = (std::rotl(all, 29) ^ lane) * kOdd;
  return all;
}

}  // namespace railfix::frame_grabber
