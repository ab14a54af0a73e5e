#include "track_detector/ground_shade.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kPieceM = 0.5;
constexpr double kShadeLookM = 0.4;            // way between two looks
constexpr double kPlaceAheadM[] = {6.0, 9.5};  // of the camera: it shows both sides of the place there
constexpr double kLitM = 3.0;                  // ground that is compared
constexpr double kFirstM = 0.5;                // behind the place; a slanting sun reaches under the edge
constexpr double kShadedM = 1.5;               // some sleepers and what lies between them
constexpr double kShadeReachM = 6.0;  // wet ground before a portal is not brighter than the dry ground close behind it
constexpr size_t kFewestShadeLooks = 2;
constexpr int kRowsApart = 4;
constexpr int kColumnsApart = 3;

}  // namespace

GroundShade::GroundShade() : looks_(kLooks) {}

void GroundShade::add(const vision::TopView& view, const vision::Sheet& sheet, double way_m) {
  if (count_ > 0 && std::abs(way_m - looks_[newest_].way_m) < kShadeLookM) return;
  newest_ = (newest_ + 1) % kLooks;
  count_ = std::min(count_ + 1, kLooks);
  Look& look = looks_[newest_];
  look.way_m = way_m;
  look.near_m = sheet.near_m;
  const int rows_a_piece = static_cast<int>(std::lround(kPieceM / sheet.cell_m));
  for (size_t piece = 0; piece < kPieces; ++piece) {
    const int first = static_cast<int>(piece) * rows_a_piece;
    const int end = first + rows_a_piece;
    double sum = 0;
    int count = 0;
    bool seen = end <= sheet.rows;
    for (int row = first; seen && row < end; row += kRowsApart) {
      seen = view.row_seen[static_cast<size_t>(row)] != 0;
      const auto* line = view.grey.ptr<float>(row);
      for (int c = 0; c < sheet.cols; c += kColumnsApart, ++count) sum += static_cast<double>(line[c]);
    }
    look.grey[piece] = seen ? static_cast<float>(sum / count) : -1.0F;
  }
}

std::optional<double> GroundShade::mean_grey(const Look& look, double from_m, double to_m) {
  const double first = std::ceil((from_m - look.near_m) / kPieceM - 0.5);
  const double end = first + std::round((to_m - from_m) / kPieceM);
  if (first < 0 || end > static_cast<double>(kPieces)) return std::nullopt;
  double sum = 0;
  for (auto piece = static_cast<size_t>(first); piece < static_cast<size_t>(end); ++piece) {
    if (look.grey[piece] < 0) return std::nullopt;
    sum += static_cast<double>(look.grey[piece]);
  }
  return sum / (end - first);
}

std::optional<double> GroundShade::share(const Look& look, double ahead_m) {
  if (ahead_m < kPlaceAheadM[0] || ahead_m > kPlaceAheadM[1]) return std::nullopt;
  const auto before = mean_grey(look, ahead_m - kLitM, ahead_m);
  std::optional<double> darkest;
  for (double from_m = kFirstM; from_m + kShadedM <= kShadeReachM; from_m += kPieceM) {
    const auto grey = mean_grey(look, ahead_m + from_m, ahead_m + from_m + kShadedM);
    if (grey && (!darkest || *grey < *darkest)) darkest = grey;
  }
  return before && darkest ? std::optional(*darkest / std::max(1.0, *before)) : std::nullopt;
}

std::optional<double> GroundShade::share(double place_m) const {
  std::array<double, kLooks> shares{};
  size_t found = 0;
  for (size_t i = 0; i < count_; ++i) {
    const Look& look = looks_[(newest_ + kLooks - i) % kLooks];
    if (const auto one = share(look, place_m - look.way_m)) shares[found++] = *one;
  }
  if (found < kFewestShadeLooks) return std::nullopt;
  auto* middle = shares.begin() + static_cast<std::ptrdiff_t>(found / 2);
  std::nth_element(shares.begin(), middle, shares.begin() + static_cast<std::ptrdiff_t>(found));
  return *middle;
}

}  // namespace railfix::track_detector
