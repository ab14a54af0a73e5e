// Camera, wheel and IMU: which of them measures, and which is left out because it contradicts the others.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "fusion/fusion_types.hpp"
#include "fusion/sensor_watch.hpp"

namespace railfix::fusion {

/// A plain value.
class MotionSensors {
 public:
  static constexpr double kBridgeS = 10.0;  // as long as the IMU alone is good for place and speed
  static constexpr double kLatelyS = 1.0;

  explicit MotionSensors(int64_t stamp_ns) : begin_ns_(stamp_ns), now_ns_(stamp_ns) {}
  void move_to(int64_t now_ns) { now_ns_ = now_ns; }
  void set_clock(int64_t stamp_ns);

  /// REQUIRES: one of kMotionSources.
  [[nodiscard]] SensorWatch& operator[](Source source) { return watches_[static_cast<size_t>(source)]; }
  [[nodiscard]] const SensorWatch& operator[](Source source) const { return watches_[static_cast<size_t>(source)]; }

  [[nodiscard]] bool used_within(Source source, double time_s) const;
  [[nodiscard]] bool used_lately(Source source) const { return used_within(source, kLatelyS); }
  /// It measured in the last moments and was believed.
  [[nodiscard]] bool measures(Source source) const;
  /// The camera is not blind, and believed.
  [[nodiscard]] bool camera_sees() const { return measures(Source::camera); }
  /// So many measured in the last moments and were believed.
  [[nodiscard]] int at_work() const;
  /// No odometer has measured in the last moments: the IMU alone is left, at best.
  [[nodiscard]] bool in_the_dark() const { return !measures(Source::camera) && !measures(Source::wheel); }
  /// Camera or wheel measured lately and was believed, or the IMU bridges a short while without them.
  [[nodiscard]] bool know_motion(double bridge_s = kBridgeS) const;
  [[nodiscard]] bool has_ever_measured(Source source) const { return (*this)[source].used_ns != 0; }
  /// An odometer has.
  [[nodiscard]] bool has_any_counted() const {
    return has_ever_measured(Source::camera) || has_ever_measured(Source::wheel);
  }

  /// Those that are isolated, a bit 1 << Source each.
  [[nodiscard]] uint32_t isolated() const;
  /// None is isolated but those of `excepted`.
  [[nodiscard]] bool are_consistent(uint32_t excepted = 0) const { return (isolated() & ~excepted) == 0; }
  /// One of these is isolated though nothing proves that it is the wrong one.
  [[nodiscard]] bool dispute(std::span<const Source> sources, std::optional<Source> but_for = {}) const;

  /// It was there, and has said nothing for so long.
  [[nodiscard]] bool silent(Source source, double timeout_s) const;
  /// Since it was believed last, or since the begin.
  [[nodiscard]] double unused_for_s(Source source) const;
  [[nodiscard]] int64_t begin_ns() const { return begin_ns_; }

 private:
  std::array<SensorWatch, kMotionSources.size()> watches_;
  int64_t begin_ns_;
  int64_t now_ns_;
};

}  // namespace railfix::fusion
