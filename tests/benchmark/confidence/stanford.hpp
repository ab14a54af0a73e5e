// Stanford diagram of any number of samples: counts on logarithmic axes.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace railfix::train {

class StanfordCounts {
 public:
  /// Absolute error and the bound that was claimed on its side (m).
  void add(double error_m, double bound_m);
  void add(const StanfordCounts& other);
  /// Error to the right, bound upwards; what lies below the diagonal was promised wrongly and is drawn red.
  [[nodiscard]] std::string svg(const std::string& title) const;

 private:
  static constexpr int kCells = 100;  // 20 a decade, from 1 cm to 1 km
  static int cell_of(double metres);
  [[nodiscard]] std::string cells_of(int shade, bool wrong) const;
  std::array<uint64_t, kCells * kCells> cells_{};
  uint64_t samples_ = 0;
  uint64_t wrong_ = 0;
};

}  // namespace railfix::train
