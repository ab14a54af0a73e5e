#include "evaluation/reports.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/units.hpp"
#include "etcs/train_position_report.hpp"
#include "track/path.hpp"
#include "track/track_finder.hpp"
#include "track/ways.hpp"

namespace railfix::evaluation {
namespace {

using dataset::TruthRow;
using track::BaliseGroup;

constexpr double kNextTracksM = 20.0;  // farther beside it may be on the way all the same, which comes back
constexpr double kFollowedM = 30'000;  // before the truth begins and behind its end
constexpr double kRunsMps = 1.0;
constexpr double kRoundingM = 1e-3;

/// The train's foot came past a group, or would have.
struct Passage {
  int64_t stamp_ns = 0;
  double distance_m = 0;  // of the truth
  double beside_m = 0;    // the group lies so far beside the way
  bool nominal_along = true;
};

struct PlacedGroup {
  const BaliseGroup* group = nullptr;
  track::PlanPose pose;  // along its nominal direction
  std::vector<Passage> passages;
};

/// A doubt that is not said may be any.
double said_or_any_m(double doubt_m) {
  return std::isfinite(doubt_m) ? doubt_m : HUGE_VAL;
}
double larger_doubt_m(const ReportRow& row) {
  return std::max(said_or_any_m(row.doubt_over_m), said_or_any_m(row.doubt_under_m));
}

bool is_placed(const TruthRow& row) {
  return std::isfinite(row.easting_m + row.northing_m + row.heading_rad);
}

/// What Q_DIRLRBG means of a real group of one balise depends on the group before it.
bool has_direction(const BaliseGroup& group) {
  return group.is_virtual || group.balises.size() > 1;
}

class Judge {
 public:
  Judge(const Truth& truth, const ReportGround& ground) : truth_(truth), ground_(ground) {
    for (const BaliseGroup& group : ground.map->balise_groups) place(group);
    const std::vector<TruthRow>& rows = truth.rows();
    for (size_t i = 1; i < rows.size(); ++i) {
      const int64_t between_ns = std::midpoint(rows[i - 1].stamp_ns, rows[i].stamp_ns);
      if (truth.at(between_ns)) pass(rows[i - 1], rows[i]);  // not over a gap
    }
    const track::TrackFinder tracks(ground.map);
    follow(tracks, rows.front(), false);
    follow(tracks, rows.back(), true);
  }

  void judge(const ReportRow& row, ReportResult& result) const {
    const std::optional<TruthRow> real = truth_.at(row.stamp_ns);
    const auto group = row.nid_lrbg ? groups_.find(*row.nid_lrbg) : groups_.end();
    const auto leave = [&](const char* why) { ++result.not_judged[why]; };
    if (!real || !is_placed(*real)) return leave("at a time without a true place");
    if (!row.nid_lrbg) return leave("without the group in the table");
    if (group == groups_.end()) return leave("of a group that the dataset's map does not have");
    const Passage* passage = passage_at(group->second, row.stamp_ns);
    const bool elsewhere = passage != nullptr ? passage->beside_m > kOwnTrackM : too_far(group->second, row, *real);
    if (passage == nullptr && !elsewhere) return leave("of a group that the true way does not lead to");
    ++result.judged;
    const bool turned = !elsewhere && wrong_direction(group->second, row, *real, *passage);
    const bool outside = !elsewhere && !holds(row, real->distance_m - passage->distance_m + ground_.foot_to_front_m);
    result.wrong_group += elsewhere ? 1 : 0;
    result.wrong_direction += turned ? 1 : 0;
    result.wrong_interval += outside ? 1 : 0;
    result.wrong += elsewhere || turned || outside ? 1 : 0;
  }

 private:
  void place(const BaliseGroup& group) {
    if (ground_.map->edge(group.edge) == nullptr) return;
    const auto nominal = group.nominal_is_forward ? track::Direction::forward : track::Direction::reverse;
    groups_[group.nid_lrbg()] = {&group, track::cab_pose(*ground_.map, {group.edge, group.offset_m, nominal}), {}};
  }

  /// Between two rows of the truth.
  void pass(const TruthRow& a, const TruthRow& b) {
    if (!is_placed(a) || !is_placed(b)) return;
    const double step_m = std::hypot(b.easting_m - a.easting_m, b.northing_m - a.northing_m);
    for (auto& [nid_lrbg, placed] : groups_) {
      const double east_m = placed.pose.easting_m - a.easting_m;
      const double north_m = placed.pose.northing_m - a.northing_m;
      if (std::hypot(east_m, north_m) > step_m + kNextTracksM) continue;
      const double ahead_a_m = ahead_m(a, placed.pose);
      const double ahead_b_m = ahead_m(b, placed.pose);
      if ((ahead_a_m > 0) == (ahead_b_m > 0)) continue;
      const double share = ahead_a_m / (ahead_a_m - ahead_b_m);
      const TruthRow& near = share < 0.5 ? a : b;
      const double beside_m = std::abs((placed.pose.easting_m - near.easting_m) * std::cos(near.heading_rad) -
                                       (placed.pose.northing_m - near.northing_m) * std::sin(near.heading_rad));
      if (beside_m > kNextTracksM) continue;
      placed.passages.push_back({near.stamp_ns, std::lerp(a.distance_m, b.distance_m, share), beside_m,
                                 std::cos(near.heading_rad - placed.pose.heading_rad) > 0});
    }
  }

  static double ahead_m(const TruthRow& row, const track::PlanPose& pose) {
    return (pose.easting_m - row.easting_m) * std::sin(row.heading_rad) +
           (pose.northing_m - row.northing_m) * std::cos(row.heading_rad);
  }

  /// Groups that lie before the truth's first place or beyond its last one, over the straight way of every switch. One
  /// that the train has run past is where it was then.
  void follow(const track::TrackFinder& tracks, const TruthRow& from, bool ahead) {
    const std::optional<track::EdgePosition> start = position_of(tracks, from);
    if (!start) return;
    const auto path = track::Path::follow(ground_.map, *start, ahead ? kFollowedM : 0, ahead ? 0 : kFollowedM);
    if (!path.ok()) return;
    for (const track::PathBaliseGroup& mark : path.value().balise_groups()) {
      const auto placed = groups_.find(mark.group->nid_lrbg());
      if (placed == groups_.end() || !placed->second.passages.empty()) continue;
      followed_[mark.group->nid_lrbg()] = {from.stamp_ns, from.distance_m + mark.distance_m, 0,
                                           mark.nominal_is_along_path};
    }
  }

  [[nodiscard]] std::optional<track::EdgePosition> position_of(const track::TrackFinder& tracks,
                                                               const TruthRow& row) const {
    if (!is_placed(row)) return std::nullopt;
    for (const track::NearTrack& near : tracks.near(row.easting_m, row.northing_m, kOwnTrackM)) {
      const double heading_rad = ground_.map->edge(near.edge)->alignment.at(near.offset_m).pose.heading_rad;
      const double along = std::cos(heading_rad - row.heading_rad);
      if (std::abs(along) < std::cos(0.2)) continue;  // a track that crosses
      return track::EdgePosition{near.edge, near.offset_m,
                                 along > 0 ? track::Direction::forward : track::Direction::reverse};
    }
    return std::nullopt;
  }

  /// The last one before, else the first one behind: the front end is where the foot has not been yet.
  [[nodiscard]] const Passage* passage_at(const PlacedGroup& placed, int64_t stamp_ns) const {
    const Passage* found = nullptr;
    for (const Passage& one : placed.passages) {
      if (found != nullptr && one.stamp_ns > stamp_ns) break;
      found = &one;
    }
    if (found != nullptr) return found;
    const auto followed = followed_.find(placed.group->nid_lrbg());
    return followed == followed_.end() ? nullptr : &followed->second;
  }

  /// No way is shorter than the straight line.
  [[nodiscard]] bool too_far(const PlacedGroup& placed, const ReportRow& row, const TruthRow& real) const {
    const double line_m = std::hypot(placed.pose.easting_m - real.easting_m, placed.pose.northing_m - real.northing_m);
    return line_m > row.d_lrbg_m + larger_doubt_m(row) + std::abs(ground_.foot_to_front_m);
  }

  [[nodiscard]] static bool wrong_direction(const PlacedGroup& placed, const ReportRow& row, const TruthRow& real,
                                            const Passage& passage) {
    if (row.q_dirlrbg == etcs::kUnknownSide) return false;
    if (has_direction(*placed.group) && (row.q_dirlrbg == etcs::kNominal) != passage.nominal_along) return true;
    if (row.q_dirtrain == etcs::kUnknownSide || std::abs(real.speed_mps) < kRunsMps) return false;
    return (row.q_dirtrain == row.q_dirlrbg) != (real.speed_mps > 0);
  }

  /// front_m: the true front end beyond the group, along the train.
  [[nodiscard]] static bool holds(const ReportRow& row, double front_m) {
    const bool sides_known = row.q_dirlrbg != etcs::kUnknownSide && row.q_dlrbg != etcs::kUnknownSide;
    const bool beyond = sides_known ? row.q_dlrbg == row.q_dirlrbg : front_m > 0;
    const double over_m = (beyond ? row.d_lrbg_m : -row.d_lrbg_m) - front_m;
    const double doubt_m =
        !sides_known ? larger_doubt_m(row) : said_or_any_m(over_m > 0 ? row.doubt_over_m : row.doubt_under_m);
    return std::abs(over_m) <= doubt_m + kRoundingM;
  }

  const Truth& truth_;
  const ReportGround& ground_;
  std::map<uint32_t, PlacedGroup> groups_;  // by NID_LRBG
  std::map<uint32_t, Passage> followed_;    // where the truth does not lead
};

}  // namespace

ReportResult judge_reports(const Truth& truth, const std::vector<ReportRow>& rows, const ReportGround& ground) {
  ReportResult result;
  std::vector<double> doubt;
  std::optional<Judge> judge;
  if (ground.map) judge.emplace(truth, ground);
  for (const ReportRow& row : rows) {
    ++result.reports;
    doubt.push_back(row.doubt_over_m + row.doubt_under_m);
    if (!row.position_known()) continue;
    ++result.with_position;
    if (judge) {
      judge->judge(row, result);
    } else {
      ++result.not_judged["because the dataset has no map that can be read"];
    }
  }
  result.doubt_m = summarise(std::move(doubt));
  return result;
}

}  // namespace railfix::evaluation
