// What the lines made in code are put together from: alignments drawn curve by curve, and a map that grows.
#pragma once

#include <string>
#include <vector>

#include "track/map.hpp"

namespace railfix::simulator {

constexpr double kLoopSpacingM = 4.7;
constexpr double kPlatformLateralM = 1.67;

/// Elements and cant of one edge, written down curve by curve.
class Drawing {
 public:
  Drawing& straight(double length_m) { return add({length_m, 0.0, 0.0}); }
  /// Clothoid in, arc, clothoid out; radius left positive, cant_m of the arc without sign.
  Drawing& curve(double radius_m, double transition_m, double arc_m, double cant_m);
  Drawing& arc(double radius_m, double arc_m) { return add({arc_m, 1.0 / radius_m, 1.0 / radius_m}); }
  [[nodiscard]] double length_m() const { return length_m_; }
  [[nodiscard]] track::Alignment from(const track::PlanPose& start, std::vector<track::GradePoint> profile) const {
    return track::Alignment::chained(start, elements_, std::move(profile), cant_);
  }

 private:
  Drawing& add(const track::Element& element) {
    elements_.push_back(element);
    length_m_ += element.length_m;
    return *this;
  }
  std::vector<track::Element> elements_;
  std::vector<track::CantPoint> cant_;
  double length_m_ = 0;
};

class LineBuilder {
 public:
  track::Map map;

  uint32_t node(track::NodeKind kind, const std::string& name, const track::PlanPose& pose);
  uint32_t edge(const std::string& name, uint32_t from, uint32_t to, track::Alignment alignment);
  uint32_t landmark(track::LandmarkKind kind, uint32_t edge, double offset_m, double lateral_m,
                    const std::string& name);
  /// Two balises 3 m apart.
  void balise_group(uint32_t edge, double offset_m);
  /// A track beside `beside` from one offset to another, left of it by lateral_m, that meets nothing.
  uint32_t second_track(const std::string& name, uint32_t beside, double from_m, double to_m, double lateral_m);
  /// A loop beside a straight level edge, left (side = +1) or right (-1), and the frogs of its two switches on both.
  uint32_t loop(const std::string& name, uint32_t beside, double side);
};

}  // namespace railfix::simulator
