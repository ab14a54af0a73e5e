// truth/rails.csv: exact inner rail edges of every picture of a simulated dataset, and how clearly they show.
#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/csv.hpp"
#include "track_detector/rail_fit.hpp"

namespace railfix::bench {

struct TrueRails {
  std::vector<Eigen::Vector2d> left;  // near to far
  std::vector<Eigen::Vector2d> right;
  [[nodiscard]] const std::vector<Eigen::Vector2d>& side(track_detector::Side s) const {
    return s == track_detector::Side::left ? left : right;
  }
};

/// By stamp. Throws BadInput.
inline std::map<int64_t, TrueRails> read_true_rails(const std::string& file) {
  auto reader = core::value_or_throw(core::CsvReader::open(file));
  std::map<int64_t, TrueRails> rails;
  while (reader.next()) {
    auto& picture = rails[core::value_or_throw(reader.integer(0))];
    (reader.text(1) == "L" ? picture.left : picture.right)
        .emplace_back(core::value_or_throw(reader.number(2)), core::value_or_throw(reader.number(3)));
  }
  return rails;
}

/// Column of a true edge in a row between its first and last known point. In a picture the edge of a curve bends most
/// in v: through three neighbouring points by a parabola.
inline std::optional<double> true_column(const std::vector<Eigen::Vector2d>& edge, double row) {
  for (size_t i = 0; i + 1 < edge.size(); ++i) {
    if (row > edge[i].y() || row < edge[i + 1].y()) continue;
    const size_t first = i + 2 < edge.size() ? i : i - 1;
    if (edge.size() < 3) return std::nullopt;
    const auto& a = edge[first];
    const auto& b = edge[first + 1];
    const auto& c = edge[first + 2];
    const double la = (row - b.y()) * (row - c.y()) / ((a.y() - b.y()) * (a.y() - c.y()));
    const double lb = (row - a.y()) * (row - c.y()) / ((b.y() - a.y()) * (b.y() - c.y()));
    const double lc = (row - a.y()) * (row - b.y()) / ((c.y() - a.y()) * (c.y() - b.y()));
    return la * a.x() + lb * b.x() + lc * c.x();
  }
  return std::nullopt;
}

/// Mean grey along a short piece of a line parallel to the edge.
inline double mean_beside(const cv::Mat& grey, const Eigen::Vector2d& edge, const Eigen::Vector2d& along,
                          double offset_px) {
  double sum = 0;
  int count = 0;
  for (int k = -4; k <= 4; ++k) {
    const Eigen::Vector2d p = edge + along * k + Eigen::Vector2d(offset_px, 0);
    const int u = static_cast<int>(std::lround(p.x()));
    const int v = static_cast<int>(std::lround(p.y()));
    if (u < 0 || v < 0 || u >= grey.cols || v >= grey.rows) continue;
    sum += grey.at<uint8_t>(v, u);
    ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

/// Does a rail's head differ from the ground on both its sides by `least` grey levels at most of the true places?
inline bool shows(const cv::Mat& grey, const TrueRails& rails, track_detector::Side side, double least) {
  const auto& edge = rails.side(side);
  int places = 0;
  int clear = 0;
  for (size_t i = 0; i < edge.size() && i < rails.left.size() && i < rails.right.size(); ++i) {
    const double gauge_px = std::abs(rails.left[i].x() - rails.right[i].x());
    if (gauge_px < 60) break;  // heads of less than 3 pixels
    const double px_per_m = (side == track_detector::Side::left ? -1 : 1) * gauge_px / 1.435;
    const size_t next = i + 1 < edge.size() ? i + 1 : i - 1;
    Eigen::Vector2d along = (edge[next] - edge[i]).normalized();
    const double head = mean_beside(grey, edge[i], along, 0.035 * px_per_m);
    const double inner = mean_beside(grey, edge[i], along, -0.05 * px_per_m);
    const double outer = mean_beside(grey, edge[i], along, 0.12 * px_per_m);
    ++places;
    if ((head - inner > least && head - outer > least) || (inner - head > least && outer - head > least)) ++clear;
  }
  return places > 0 && 2 * clear > places;
}

}  // namespace railfix::bench
