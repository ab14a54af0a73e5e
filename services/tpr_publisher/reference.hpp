// The balise group that a report refers to, and those that were passed before it. "Along" means along the axis that the
// camera looks.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "track/map.hpp"

namespace railfix::tpr_publisher {

/// A group that was passed before the LRBG, or that lies behind it on the map. Trackside may still refer to it
/// (SUBSET-026 3.6.2.2.1).
struct EarlierGroup {
  const track::BaliseGroup* group = nullptr;
  const track::BaliseGroup* previous = nullptr;
  bool nominal_along = true;
  bool from_previous_along = true;
  double ahead_m = 0;  // the present one lies so far beyond it, along
  double doubt_m = 0;  // that way may be longer or shorter by so much
  bool passed = false;
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

  /// This group, or that earlier one, as a reference. Round a loop it was passed more than once: the passage from which
  /// the foot is as far as expected, or, expected nowhere, the last one.
  [[nodiscard]] std::optional<Reference> remembered(uint32_t nid_lrbg,
                                                    std::optional<double> expected_foot_m = std::nullopt) const;
};

/// `present` has been passed behind `last`, whose groups it remembers: eight, no farther away than `within_m`.
Reference passed_behind(Reference present, const Reference& last, double within_m);

/// Up to `within_m` from this place on the only way that leads there, the nearest first. `ahead`: as the camera looks,
/// otherwise behind it.
std::vector<Reference> groups_on_only_way(const std::shared_ptr<const track::Map>& map, const track::EdgePosition& foot,
                                          bool ahead, double within_m);

/// The nearest of these, which remembers the others.
std::optional<Reference> nearest_of(const std::vector<Reference>& groups);

}  // namespace railfix::tpr_publisher
