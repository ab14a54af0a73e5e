#include "evaluation/plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "escape_html.hpp"

namespace railfix::evaluation {
namespace {

constexpr double kWidth = 720;
constexpr double kHeight = 300;
constexpr double kLeft = 84;
constexpr double kRight = 14;
constexpr double kTop = 30;
constexpr double kBottom = 44;

std::string format(const char* pattern, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), pattern, value);
  return text.data();
}
std::string px(double value) {
  return format("%.1f", value);
}

struct Range {
  double low = INFINITY;
  double high = -INFINITY;
  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  /// Never empty, a little room at both ends.
  void settle(double room) {
    if (!(low <= high)) low = high = 0;
    const double margin = high > low ? (high - low) * room : std::max(std::abs(low) * 0.1, 1e-3);
    low -= margin;
    high += margin;
  }
};

/// From values to pixels of the drawing.
struct Frame {
  Range x;
  Range y;
  double height = kHeight;
  [[nodiscard]] double px_x(double value) const {
    return kLeft + (value - x.low) / (x.high - x.low) * (kWidth - kLeft - kRight);
  }
  [[nodiscard]] double px_y(double value) const {
    return height - kBottom - (value - y.low) / (y.high - y.low) * (height - kTop - kBottom);
  }
};

void widen(Range& range, double length) {
  const double middle = (range.low + range.high) / 2;
  range.low = middle - length / 2;
  range.high = middle + length / 2;
}

void make_axes_equal(Frame& frame) {
  const double across = (frame.x.high - frame.x.low) / (kWidth - kLeft - kRight);
  const double up = (frame.y.high - frame.y.low) / (frame.height - kTop - kBottom);
  const double scale = std::max(across, up);
  widen(frame.x, scale * (kWidth - kLeft - kRight));
  widen(frame.y, scale * (frame.height - kTop - kBottom));
}

std::string text_at(double x, double y, const char* anchor, const std::string& text, const std::string& more = "") {
  return "<text x=\"" + px(x) + "\" y=\"" + px(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         tool::escape_html(text) + "</text>\n";
}

std::string line_between(double x1, double y1, double x2, double y2, const char* style) {
  return "<line x1=\"" + px(x1) + "\" y1=\"" + px(y1) + "\" x2=\"" + px(x2) + "\" y2=\"" + px(y2) + "\" " + style +
         "/>\n";
}

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9);
  if (step < 1e-4) return format("%.3g", value);
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value == 0 ? 0.0 : value);
  return text.data();
}

std::string axes(const Frame& frame, const std::string& title, const std::string& x_label, const std::string& y_label) {
  const char* const grid = "stroke=\"#e4e7eb\"";
  std::string out = "<svg viewBox=\"0 0 " + px(kWidth) + " " + px(frame.height) + "\" role=\"img\" aria-label=\"" +
                    tool::escape_html(title) + "\">\n";
  out += text_at(kLeft, 18, "start", title, " class=\"title\"");
  const auto x_ticks = ticks(frame.x.low, frame.x.high, 8);
  for (const double tick : x_ticks) {
    const double x = frame.px_x(tick);
    out += line_between(x, kTop, x, frame.height - kBottom, grid);
    out += text_at(x, frame.height - kBottom + 16, "middle",
                   tick_text(tick, x_ticks.size() > 1 ? x_ticks[1] - x_ticks[0] : 1));
  }
  const auto y_ticks = ticks(frame.y.low, frame.y.high, 6);
  for (const double tick : y_ticks) {
    const double y = frame.px_y(tick);
    out += line_between(kLeft, y, kWidth - kRight, y, grid);
    out += text_at(kLeft - 6, y + 4, "end", tick_text(tick, y_ticks.size() > 1 ? y_ticks[1] - y_ticks[0] : 1));
  }
  out += text_at((kLeft + kWidth - kRight) / 2, frame.height - 8, "middle", x_label);
  const double middle = (kTop + frame.height - kBottom) / 2;
  out += text_at(14, middle, "middle", y_label, " transform=\"rotate(-90 14 " + px(middle) + ")\"");
  return out;
}

using Pixel = std::pair<double, double>;

/// First, lowest, highest and last pixel of each pixel column.
std::vector<Pixel> thin_by_column(const std::vector<Pixel>& pixels) {
  std::vector<Pixel> kept;
  size_t begin = 0;
  while (begin < pixels.size()) {
    size_t end = begin;
    size_t low = begin;
    size_t high = begin;
    while (end < pixels.size() && std::floor(pixels[end].first) == std::floor(pixels[begin].first)) {
      if (pixels[end].second < pixels[low].second) low = end;
      if (pixels[end].second > pixels[high].second) high = end;
      ++end;
    }
    std::array<size_t, 4> keep = {begin, low, high, end - 1};
    std::sort(keep.begin(), keep.end());
    for (size_t i = 0; i < keep.size(); ++i) {
      if (i == 0 || keep[i] != keep[i - 1]) kept.push_back(pixels[keep[i]]);
    }
    begin = end;
  }
  return kept;
}

std::vector<Pixel> thin_by_distance(const std::vector<Pixel>& pixels) {
  std::vector<Pixel> kept;
  for (const Pixel& pixel : pixels) {
    const bool far =
        kept.empty() || std::hypot(pixel.first - kept.back().first, pixel.second - kept.back().second) > 0.7;
    if (far) kept.push_back(pixel);
  }
  return kept;
}

std::string polyline(const std::vector<Pixel>& pixels, const std::string& color) {
  if (pixels.empty()) return "";
  std::string out = "<polyline fill=\"none\" stroke=\"" + color + "\" stroke-width=\"1.4\" points=\"";
  for (const auto& [x, y] : pixels) out += px(x) + "," + px(y) + " ";
  return out + "\"/>\n";
}

std::string draw(const Series& series, const Frame& frame, bool thin_columns) {
  std::string out;
  std::vector<Pixel> run;
  const auto finish = [&] {
    out += polyline(thin_columns ? thin_by_column(run) : thin_by_distance(run), series.color);
    run.clear();
  };
  for (const auto& [x, y] : series.points) {
    if (std::isfinite(x) && std::isfinite(y)) {
      run.emplace_back(frame.px_x(x), frame.px_y(y));
    } else {
      finish();
    }
  }
  finish();
  return out;
}

std::string legend(const std::vector<Series>& series) {
  std::string out;
  double x = kWidth - kRight;
  for (auto one = series.rbegin(); one != series.rend(); ++one) {
    if (one->name.empty()) continue;
    out += text_at(x, 18, "end", one->name, " fill=\"" + one->color + "\"");
    x -= 7.0 * static_cast<double>(one->name.size()) + 16.0;
  }
  return out;
}

}  // namespace

std::vector<double> ticks(double low, double high, int count) {
  const double rough = (high - low) / count;
  if (!(rough > 0) || !std::isfinite(rough)) return {low};
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> result;
  const double first = std::ceil(low / step - 1e-9);
  for (int i = 0; i <= 2 * count && (first + i) * step <= high + 1e-9 * step; ++i) result.push_back((first + i) * step);
  return result;
}

std::string line_svg(const Plot& plot) {
  Frame frame;
  if (plot.equal_axes) frame.height = 1.6 * kHeight;
  for (const Series& series : plot.series) {
    for (const auto& [x, y] : series.points) {
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      frame.x.include(x);
      frame.y.include(y);
    }
  }
  frame.x.settle(plot.equal_axes ? 0.05 : 0);
  frame.y.settle(0.05);
  if (plot.equal_axes) make_axes_equal(frame);
  std::string out = axes(frame, plot.title, plot.x_label, plot.y_label);
  for (const Series& series : plot.series) out += draw(series, frame, !plot.equal_axes);
  return out + legend(plot.series) + "</svg>\n";
}

std::string stanford_svg(const Points& error_and_bound) {
  constexpr int kCells = 60;
  Frame frame;
  frame.height = 1.6 * kHeight;
  frame.x.include(0);
  for (const auto& [error, bound] : error_and_bound) frame.x.include(std::max(error, bound));
  frame.x.settle(0.02);
  frame.x.low = 0;
  frame.y = frame.x;
  std::vector<int> cells(kCells * kCells);
  const double cell = frame.x.high / kCells;
  size_t wrong = 0;
  for (const auto& [error, bound] : error_and_bound) {
    wrong += error > bound ? 1 : 0;
    const int column = std::clamp(static_cast<int>(error / cell), 0, kCells - 1);
    const int row = std::clamp(static_cast<int>(bound / cell), 0, kCells - 1);
    ++cells[static_cast<size_t>(row * kCells + column)];
  }
  const int most = error_and_bound.empty() ? 1 : *std::max_element(cells.begin(), cells.end());
  std::string out = axes(frame, "Stanford diagram", "error along the track (m)", "claimed bound (m)");
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const int count = cells[static_cast<size_t>(row * kCells + column)];
      if (count == 0) continue;
      const double strength = 0.25 + 0.75 * std::log1p(count) / std::log1p(most);
      const double x = frame.px_x(column * cell);
      const double y = frame.px_y((row + 1) * cell);
      out += "<rect x=\"" + px(x) + "\" y=\"" + px(y) + "\" width=\"" + px(frame.px_x((column + 1) * cell) - x) +
             "\" height=\"" + px(frame.px_y(row * cell) - y) + "\" fill=\"" + (column > row ? "#c62828" : "#1565c0") +
             "\" fill-opacity=\"" + format("%.2f", strength) + "\"/>\n";
    }
  }
  out += line_between(frame.px_x(0), frame.px_y(0), frame.px_x(frame.x.high), frame.px_y(frame.x.high),
                      "stroke=\"#444\" stroke-dasharray=\"5 4\"");
  out += text_at(kWidth - kRight, 18, "end",
                 std::to_string(wrong) + " of " + std::to_string(error_and_bound.size()) +
                     " samples below the diagonal: bound too small");
  return out + "</svg>\n";
}

}  // namespace railfix::evaluation
