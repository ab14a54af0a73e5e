#include "stanford.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace railfix::train {
namespace {

constexpr double kLeastM = 0.01;
constexpr double kCellsPerDecade = 20;
constexpr int kLeft = 70;
constexpr int kTop = 40;
constexpr int kCellPx = 5;
constexpr int kSize = 500;
constexpr int kShades = 12;

template <class... Numbers>
std::string format(const char* text, Numbers... numbers) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, text, numbers...);
  return buffer;
}

std::string axes() {
  std::string out;
  for (int decade = 0; decade <= 5; ++decade) {
    const int at = static_cast<int>(decade * kCellsPerDecade) * kCellPx;
    const double metres = kLeastM * std::pow(10.0, decade);
    out += format("<path d=\"M%d %d v%d M%d %d h%d\" stroke=\"#ddd\"/>\n", kLeft + at, kTop, kSize, kLeft,
                  kTop + kSize - at, kSize);
    out += format("<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">%g</text>\n", kLeft + at, kTop + kSize + 18, metres);
    out += format("<text x=\"%d\" y=\"%d\" text-anchor=\"end\">%g</text>\n", kLeft - 6, kTop + kSize - at + 4, metres);
  }
  out += format("<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">error along the track (m)</text>\n", kLeft + kSize / 2,
                kTop + kSize + 38);
  out += format("<text transform=\"translate(18 %d) rotate(-90)\" text-anchor=\"middle\">promised bound (m)</text>\n",
                kTop + kSize / 2);
  return out;
}

}  // namespace

int StanfordCounts::cell_of(double metres) {
  const double place = kCellsPerDecade * std::log10(std::max(metres, kLeastM) / kLeastM);
  return std::clamp(static_cast<int>(place), 0, kCells - 1);
}

void StanfordCounts::add(double error_m, double bound_m) {
  ++cells_[static_cast<size_t>(cell_of(bound_m) * kCells + cell_of(error_m))];
  ++samples_;
  if (!(error_m <= bound_m)) ++wrong_;
}

void StanfordCounts::add(const StanfordCounts& other) {
  for (size_t i = 0; i < cells_.size(); ++i) cells_[i] += other.cells_[i];
  samples_ += other.samples_;
  wrong_ += other.wrong_;
}

// One path for all cells of one shade: a picture of 50 kB instead of 300.
std::string StanfordCounts::cells_of(int shade, bool wrong) const {
  const double most = std::log1p(static_cast<double>(*std::max_element(cells_.begin(), cells_.end())));
  std::string squares;
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const auto count = cells_[static_cast<size_t>(row * kCells + column)];
      if (count == 0 || (column > row) != wrong) continue;
      const int darkness = static_cast<int>(std::ceil(kShades * std::log1p(static_cast<double>(count)) / most));
      if (darkness != shade) continue;
      squares += format("M%d %dh%dv%dh-%dz", kLeft + column * kCellPx, kTop + kSize - (row + 1) * kCellPx, kCellPx,
                        kCellPx, kCellPx);
    }
  }
  if (squares.empty()) return squares;
  return format("<path fill=\"%s\" fill-opacity=\"%.2f\" d=\"", wrong ? "#c62828" : "#1565c0",
                0.15 + 0.85 * shade / kShades) +
         squares + "\"/>\n";
}

std::string StanfordCounts::svg(const std::string& title) const {
  std::string out = format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" font-family=\"sans-serif\" "
      "font-size=\"13\">\n<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
      kLeft + kSize + 30, kTop + kSize + 55);
  out += "<text x=\"70\" y=\"18\">" + title + "</text>\n";
  out += format("<text x=\"70\" y=\"34\">%llu of %llu states outside the promised interval</text>\n",
                static_cast<unsigned long long>(wrong_), static_cast<unsigned long long>(samples_));
  out += axes();
  for (const bool wrong : {false, true}) {
    for (int shade = 1; shade <= kShades; ++shade) out += cells_of(shade, wrong);
  }
  out += format("<path d=\"M%d %d L%d %d\" stroke=\"#444\" stroke-dasharray=\"5 4\"/>\n", kLeft, kTop + kSize,
                kLeft + kSize, kTop);
  return out + "</svg>\n";
}

}  // namespace railfix::train
