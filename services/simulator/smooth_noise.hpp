// Noise without steps: smooth between values on a lattice.
#pragma once

namespace railfix::simulator {

/// Between the values that `corner(i, j)` has where x and y are whole. REQUIRES: x and y not negative.
template <class Corner>
float smooth_noise(float x, float y, Corner corner) {
  const int i = static_cast<int>(x);
  const int j = static_cast<int>(y);
  const float fx = x - static_cast<float>(i);
  const float fy = y - static_cast<float>(j);
  const float wx = fx * fx * (3.0F - 2.0F * fx);
  const float wy = fy * fy * (3.0F - 2.0F * fy);
  const float top = corner(i, j) + wy * (corner(i, j + 1) - corner(i, j));
  const float bottom = corner(i + 1, j) + wy * (corner(i + 1, j + 1) - corner(i + 1, j));
  return top + wx * (bottom - top);
}

}  // namespace railfix::simulator
