#include "track/import/xml/net_heights.hpp"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <string>

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kClimbToldM = 0.05;
constexpr double kStepToldM = 1.0;
constexpr size_t kMostTold = 10;

/// Of one track by itself, from 0 on.
std::vector<GradePoint> profile_of(const NetTrack& track) {
  const double length_m = track.track.alignment.length_m();
  const double scale = length_m / track.length_m;
  std::vector<GradePoint> profile{{0, 0, 0, true}};
  double grade = 0;
  const auto reach = [&](double offset_m, double curve_length_m) {
    const GradePoint last = profile.back();
    const double height_m = last.elevation_m + grade * (offset_m - last.offset_m);
    if (offset_m > last.offset_m) profile.push_back({offset_m, height_m, curve_length_m});
  };
  for (const NetSlope& slope : track.slopes) {
    reach(std::clamp(slope.offset_m, 0.0, track.length_m) * scale, slope.curve_length_m * scale);
    grade = slope.grade;
    profile.back().is_guess = slope.is_guess;
  }
  reach(length_m, 0);
  return profile;
}

class Heights {
 public:
  Heights(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes, const std::map<size_t, double>& told)
      : net_(net), nodes_(nodes), told_(told), height_at_(told) {
    for (size_t i = 0; i < nodes.size(); ++i) {
      profiles_.push_back(profile_of(net.tracks[i]));
      tracks_at_[nodes[i].first].push_back(i);
      tracks_at_[nodes[i].second].push_back(i);
    }
  }

  std::vector<std::vector<GradePoint>> make() {
    spread();
    settle();
    for (size_t i = 0; i < profiles_.size(); ++i) lift(i);
    tell_climbs();
    return std::move(profiles_);
  }

 private:
  [[nodiscard]] bool has_slopes(size_t track) const { return !net_.tracks[track].slopes.empty(); }
  [[nodiscard]] double length(size_t track) const { return net_.tracks[track].track.alignment.length_m(); }
  [[nodiscard]] double climb(size_t track) const {
    return height_at_.at(nodes_[track].second) - height_at_.at(nodes_[track].first);
  }

  /// From the nodes whose height is told, and tracks with slopes first: what is level for want of them must not set a
  /// height that slopes say.
  void spread() {
    std::deque<size_t> waiting;
    std::vector<bool> done(profiles_.size(), false);
    const auto wait_at = [&](size_t node) {
      for (const size_t next : tracks_at_[node]) has_slopes(next) ? waiting.push_front(next) : waiting.push_back(next);
    };
    const auto go = [&] {
      while (!waiting.empty()) {
        const size_t track = waiting.front();
        waiting.pop_front();
        if (done[track]) continue;
        done[track] = true;
        set_heights(track);
        for (const size_t node : {nodes_[track].first, nodes_[track].second}) wait_at(node);
      }
    };
    for (const auto& [node, height_m] : told_) wait_at(node);
    go();
    for (const bool with_slopes : {true, false}) {
      for (size_t first = 0; first < profiles_.size(); ++first) {
        if (has_slopes(first) != with_slopes) continue;
        waiting.push_back(first);
        go();
      }
    }
  }

  void set_heights(size_t track) {
    const auto [begin, end] = nodes_[track];
    const double rise_m = profiles_[track].back().elevation_m;
    if (height_at_.contains(end)) height_at_.try_emplace(begin, height_at_[end] - rise_m);
    const double height_m = height_at_.try_emplace(begin, 0).first->second;
    height_at_.try_emplace(end, height_m + rise_m);
  }

  /// Nodes that tracks with slopes join rise and fall together.
  size_t run_of(size_t node) {
    while (runs_[node] != node) node = runs_[node] = runs_[runs_[node]];
    return node;
  }

  /// Runs whose height nothing says: nodes without slopes, and where some heights are told all others too.
  std::map<size_t, Eigen::Index> open_runs() {
    for (const auto& [node, tracks] : tracks_at_) runs_[node] = node;
    for (size_t track = 0; track < nodes_.size(); ++track) {
      if (has_slopes(track)) runs_[run_of(nodes_[track].first)] = run_of(nodes_[track].second);
    }
    std::map<size_t, bool> held;
    for (const auto& [node, tracks] : tracks_at_) {
      const bool has_own = std::any_of(tracks.begin(), tracks.end(), [&](size_t track) { return has_slopes(track); });
      held[run_of(node)] |= told_.contains(node) || (told_.empty() && has_own);
    }
    std::map<size_t, Eigen::Index> open;
    for (const auto& [run, is_held] : held) {
      if (!is_held) open.emplace(run, std::ssize(open));
    }
    return open;
  }

  /// An open run lies where all tracks without slopes that leave it climb evenly: what comes to it is what leaves it, a
  /// sparse linear system. Where nothing holds a part it stays as it is.
  void settle() {
    const std::map<size_t, Eigen::Index> open = open_runs();
    if (open.empty()) return;
    constexpr double kStays = 1e-12;
    std::vector<Eigen::Triplet<double>> terms;
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(std::ssize(open));
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(std::ssize(open));
    const auto balance = [&](size_t node, size_t other, double length_m) {
      const auto own = open.find(run_of(node));
      if (own == open.end()) return;
      const Eigen::Index row = own->second;
      weights[row] += 1 / length_m;
      sums[row] += (height_at_[other] - height_at_[node]) / length_m;
      if (const auto column = open.find(run_of(other)); column != open.end())
        terms.emplace_back(row, column->second, -1 / length_m);
    };
    for (size_t track = 0; track < nodes_.size(); ++track) {
      if (has_slopes(track)) continue;
      balance(nodes_[track].first, nodes_[track].second, length(track));
      balance(nodes_[track].second, nodes_[track].first, length(track));
    }
    for (Eigen::Index row = 0; row < weights.size(); ++row)
      terms.emplace_back(row, row, weights[row] > 0 ? weights[row] * (1 + kStays) : 1.0);
    Eigen::SparseMatrix<double> matrix(std::ssize(open), std::ssize(open));
    matrix.setFromTriplets(terms.begin(), terms.end());
    const Eigen::VectorXd lifts = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(sums);
    for (auto& [node, height_m] : height_at_) {
      if (const auto run = open.find(run_of(node)); run != open.end()) height_m += lifts[run->second];
    }
  }

  void lift(size_t track) {
    std::vector<GradePoint>& profile = profiles_[track];
    const double begin_m = height_at_[nodes_[track].first];
    for (GradePoint& point : profile) point.elevation_m += begin_m;
    if (has_slopes(track)) {
      tell_step(track);
      return;
    }
    profile.back().elevation_m += climb(track);
    if (std::abs(climb(track)) < kClimbToldM) return;
    climbs_.emplace_back(std::abs(climb(track)), "track " + net_.tracks[track].track.name +
                                                     " has no gradients; it climbs evenly from " + told_m(begin_m) +
                                                     " to " + told_m(profile.back().elevation_m) +
                                                     ", where others put its ends");
  }

  void tell_climbs() {
    std::ranges::stable_sort(climbs_, std::greater{}, &std::pair<double, std::string>::first);
    for (size_t i = 0; i < std::min(kMostTold, climbs_.size()); ++i) net_.problems.push_back(climbs_[i].second);
    if (climbs_.size() > kMostTold)
      net_.problems.push_back(std::to_string(climbs_.size() - kMostTold) +
                              " more tracks have no gradients and climb evenly between others, by less");
  }

  void tell_step(size_t track) {
    const double step_m = profiles_[track].back().elevation_m - height_at_[nodes_[track].second];
    if (std::abs(step_m) < kStepToldM) return;
    net_.problems.push_back("track " + net_.tracks[track].track.name + " ends " + told_m(std::abs(step_m)) +
                            (step_m > 0 ? " above" : " below") +
                            " where others put its end, by its gradients; heights step there");
  }

  RailNet& net_;
  const std::vector<std::pair<size_t, size_t>>& nodes_;
  const std::map<size_t, double>& told_;  // nodes
  std::vector<std::vector<GradePoint>> profiles_;
  std::map<size_t, std::vector<size_t>> tracks_at_;  // nodes
  std::map<size_t, double> height_at_;               // nodes
  std::map<size_t, size_t> runs_;                    // nodes: another one of the same run, or itself
  std::vector<std::pair<double, std::string>> climbs_;
};

}  // namespace

std::vector<std::vector<GradePoint>> net_profiles(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes,
                                                  const std::map<size_t, double>& heights) {
  const bool without_slopes = std::ranges::all_of(net.tracks, &std::vector<NetSlope>::empty, &NetTrack::slopes);
  if (without_slopes && heights.empty()) return std::vector<std::vector<GradePoint>>(net.tracks.size());
  if (heights.empty())
    net.problems.emplace_back(
        "heights are summed from the slopes, from 0 m where the tracks begin: they are no heights above the sea");
  return Heights(net, nodes, heights).make();
}

}  // namespace railfix::track
