// Whether a number is one that may be: all are false for NaN.
#pragma once

namespace railfix::core {

constexpr bool within(double number, double least, double most) {
  return number >= least && number <= most;
}
/// Either side of 0.
constexpr bool up_to(double number, double most) {
  return within(number, -most, most);
}
constexpr bool positive(double number, double most) {
  return number > 0 && number <= most;
}

}  // namespace railfix::core
