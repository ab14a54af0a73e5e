// The balise group that a report refers to, and those that were passed before it. "Along" means along the axis that the
// camera looks.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "track/map.hpp"

namespace railfix::tpr_publisher {

/// An LRBG of before. Trackside may still refer to it (SUBSET-026 3.6.2.2.1).
struct EarlierGroup {
  const track::BaliseGroup* group = nullptr;
  const track::BaliseGroup* previous = nullptr;
  bool nominal_along = true;
  bool from_previous_along = true;
  double ahead_m = 0;  // the present one lies so far beyond it, along
  double doubt_m = 0;  // that way may be longer or shorter by so much
};

struct Reference {
  const track::BaliseGroup* group = nullptr;
  const track::BaliseGroup* previous = nullptr;  // LRBG before this one, nullptr = not known
  bool nominal_along = true;                     // the group's nominal direction runs along
  bool from_previous_along = true;               // the way from `previous` to `group` runs along
  double foot_m = 0;                             // camera's foot beyond the group, along; negative = in front of it
  double doubt_m = 0;                            // the way from the group may be longer or shorter by so much
  double furthest_m = 0;                         // the foot was so far from it since it was passed
  bool passed = false;                           // false: taken from the map, because it lies behind
  std::vector<EarlierGroup> earlier{};           // the last one first

  /// This group, or that earlier one, as a reference.
  [[nodiscard]] std::optional<Reference> remembered(uint32_t nid_lrbg) const;
};

/// `present` has been passed behind `last`, whose groups it remembers: eight, no farther away than `within_m`.
Reference passed_behind(Reference present, const Reference& last, double within_m);

/// On the only way on which a train at this place can have come, no farther than `within_m`, the nearest first.
/// `ahead`: its front is at the other end than the camera's, and behind it is what the camera sees ahead.
std::vector<Reference> groups_behind(const std::shared_ptr<const track::Map>& map, const track::EdgePosition& foot,
                                     bool ahead, double within_m);

}  // namespace railfix::tpr_publisher
