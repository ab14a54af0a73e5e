// Which balise group a position report refers to: the last relevant balise group (LRBG), real or virtual
// (SUBSET-026 3.6.2.2).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "tpr_publisher/reference.hpp"
#include "tpr_publisher/undeclared_way.hpp"
#include "track/map.hpp"

namespace railfix::tpr_publisher {

/// Follows the camera's foot over the map. A group counts as passed when the foot's estimate passes it, in either
/// direction. The distance to the LRBG is summed along the way really run, so that it stays right beyond switches.
///
/// Behind a facing switch the followed leg is a guess until the track is declared: the distance goes on from the group
/// before the switch, and no group is taken. Once it is declared, the groups on the way that really led there count as
/// passed. Where ways of different legs have joined again and nobody said which one it was, those that all of them
/// have.
///
/// A declaration may be taken back, or another leg be declared: then the groups taken on the leg count no more, and the
/// one before the switch is the reference again. Doubted without a switch to go back to, no group is known.
///
/// So it is in one of three states. No switch is open: groups count as they are passed. The leg is a guess: groups
/// wait. The leg was declared, and the switch is less than 3 km away: groups count, and may be taken back. From the
/// first and the third go_undeclared() leads to the second. From the second go_declared() leads to the third, or, where
/// no way is known that the train may have come, with acquire() to the first; from the third, where the place lies on
/// another leg, the same way. run_on() leads from the third to the first at 3 km, lose() from any to the first.
class BaliseTracker {
 public:
  /// At the start, and after a jump to another track, the nearest group up to `search_behind_m` behind the train is
  /// taken, when only one way leads from there. Eight more within this way are remembered, passed or on the map.
  BaliseTracker(std::shared_ptr<const track::Map> map, double search_behind_m);

  /// REQUIRES: the direction is known. A place that is not on the map loses the reference. `heard`: the train was
  /// followed from the place before to this one.
  void update(const track::EdgePosition& foot, bool declared, bool heard = true);
  void lose();
  /// The train's front is at the other end than the camera's, so that behind it is what the camera sees ahead. A
  /// reference that was not passed but taken from the map is taken anew.
  void turn_front(bool is_at_other_end);
  [[nodiscard]] const std::optional<Reference>& reference() const { return reference_; }
  /// So many times a group that had been taken for passed counted no more, nor one of another track.
  [[nodiscard]] uint32_t taken_back() const { return taken_back_; }
  /// So many times the train went over its LRBG once more: round a ring, or back over it.
  [[nodiscard]] uint32_t passed_again() const { return passed_again_; }
  /// How far the train has come since its track was declared last; nothing while it is declared.
  [[nodiscard]] std::optional<double> undeclared_m() const;
  /// The way on the map from the place before to the present one, along; nothing where nobody knows it.
  [[nodiscard]] std::optional<double> step_m() const { return step_m_; }
  /// This group as a reference: the present one, one of those before it (Reference::remembered), or one up to `ahead_m`
  /// in front of the train, where only one way leads there.
  [[nodiscard]] std::optional<Reference> find(uint32_t nid_lrbg, double ahead_m,
                                              std::optional<double> expected_foot_m = std::nullopt) const;

 private:
  /// A group on the way from the last place to this one.
  struct Passed {
    const track::BaliseGroup* group;
    double way_m;  // from the last place, along
    bool nominal_along;
    double doubt_m = 0;  // as in Reference
  };
  struct Step {
    double way_m = 0;
    std::vector<Passed> groups{};  // near it, passed or not
    bool divides = false;          // over a switch that could have led elsewhere
  };
  struct LegSinceSwitch {
    std::optional<track::EdgePosition> from;  // before the switch; nothing = no place is known to go back to
    std::optional<Reference> reference;       // there
    Turns turns;
  };
  [[nodiscard]] bool leg_is_guess() const { return leg_ && !leg_declared_; }
  [[nodiscard]] std::optional<Step> step_to(const track::EdgePosition& foot) const;
  [[nodiscard]] std::optional<Step> step_on_edge(const track::EdgePosition& foot) const;
  [[nodiscard]] std::optional<Step> step_over_edges(const track::EdgePosition& foot) const;
  [[nodiscard]] LegSinceSwitch leg_since(const track::EdgePosition& foot);
  /// The stem lies `way_m` behind the last place (along; 0 = it is the last place).
  [[nodiscard]] LegSinceSwitch leg_from(const track::EdgePosition& stem, double way_m, bool forwards) const;
  void leave_leg(const Step& step);
  void note_direction(double way_m);
  void go_back_to(LegSinceSwitch leg);
  void leave_doubted(const Step& step);
  void go_undeclared(const track::EdgePosition& foot);
  void doubt_legs(const track::EdgePosition& foot);
  [[nodiscard]] bool go_declared(const track::EdgePosition& foot);
  void run_on(double way_m);
  [[nodiscard]] std::vector<Passed> groups_on(const std::vector<WayBetween>& ways) const;
  void pass(std::vector<Passed> passed, double step_m);
  void acquire(const track::EdgePosition& foot);
  void acquire_behind_turned_front(const track::EdgePosition& foot);
  [[nodiscard]] std::optional<Reference> nearest_behind(const track::EdgePosition& foot) const;
  /// A train that runs so, along or not, runs with its front first.
  [[nodiscard]] bool front_first(bool along) const { return along != front_at_other_end_; }

  std::shared_ptr<const track::Map> map_;
  track::Ways ways_;
  std::unordered_map<uint32_t, std::vector<const track::BaliseGroup*>> groups_on_;  // edge id
  double search_behind_m_;
  std::optional<track::EdgePosition> last_;
  std::optional<LegSinceSwitch> leg_;
  bool leg_declared_ = false;  // of `leg_`, when there is one
  std::optional<Reference> reference_;
  uint32_t taken_back_ = 0;
  uint32_t passed_again_ = 0;
  std::optional<double> step_m_;
  bool front_at_other_end_ = false;
  bool front_turned_ = false;  // since a reference was looked for
  bool forwards_ = true;       // the way that the train runs, seen from the camera's cab
  double moved_back_m_ = 0;
};

}  // namespace railfix::tpr_publisher
