// Which balise group a position report refers to: the last relevant balise group (LRBG), real or virtual
// (SUBSET-026 3.6.2.2).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "track/map.hpp"

namespace railfix::tpr_publisher {

/// "Along" means along the cab's forward axis.
struct Reference {
  const track::BaliseGroup* group = nullptr;
  const track::BaliseGroup* previous = nullptr;  // LRBG before this one, nullptr = not known
  bool nominal_along = true;                     // the group's nominal direction runs along
  bool from_previous_along = true;               // the way from `previous` to `group` runs along
  double foot_m = 0;                             // camera's foot beyond the group, along; negative = in front of it
};

/// Follows the camera's foot over the map. A group counts as passed when the foot's estimate passes it, in either
/// direction. The distance to the LRBG is summed along the way really run, so that it stays right beyond switches.
class BaliseTracker {
 public:
  /// At the start, and after a jump to another track, the nearest group up to `search_behind_m` behind the train is
  /// taken.
  BaliseTracker(std::shared_ptr<const track::Map> map, double search_behind_m);

  /// REQUIRES: the direction is known. A place that is not on the map loses the reference.
  void update(const track::EdgePosition& foot);
  void lose();
  [[nodiscard]] const std::optional<Reference>& reference() const { return reference_; }
  /// How far the foot is beyond this group, along, when it is the reference or lies behind the train, no farther than
  /// one is looked for at the start.
  [[nodiscard]] std::optional<double> foot_beyond_m(uint32_t nid_lrbg) const;

 private:
  /// A group on the way from the last place to this one.
  struct Passed {
    const track::BaliseGroup* group;
    double way_m;  // from the last place, along
    bool nominal_along;
  };
  [[nodiscard]] bool step_on_edge(const track::EdgePosition& foot);
  [[nodiscard]] bool step_over_edges(const track::EdgePosition& foot);
  void pass(std::vector<Passed> passed, double step_m);
  void acquire(const track::EdgePosition& foot);

  std::shared_ptr<const track::Map> map_;
  std::unordered_map<uint32_t, std::vector<const track::BaliseGroup*>> groups_on_;  // edge id
  double search_behind_m_;
  std::optional<track::EdgePosition> last_;
  std::optional<Reference> reference_;
};

}  // namespace railfix::tpr_publisher
