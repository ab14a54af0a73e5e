// Line plots and density plots as inline SVG.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace railfix::evaluation {

using Points = std::vector<std::pair<double, double>>;

struct Series {
  std::string name;
  std::string color;
  Points points;  // a point that is not finite interrupts the line
};

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<Series> series;
  bool equal_axes = false;  // a map: one metre is as long across as up, and x need not grow along the line
};

/// A drawing of its own size; tens of thousands of points become at most four a pixel column, peaks kept.
std::string line_svg(const Plot& plot);

/// Stanford diagram: how often which error (x) came with which claimed bound (y). Below the diagonal the claim was
/// wrong.
std::string stanford_svg(const Points& error_and_bound);

/// Round numbers, at most about `count`, that span the range.
std::vector<double> ticks(double low, double high, int count);

}  // namespace railfix::evaluation
