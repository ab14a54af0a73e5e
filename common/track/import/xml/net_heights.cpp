#include "track/import/xml/net_heights.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>

namespace railfix::track {
namespace {

constexpr double kClimbToldM = 0.05;
constexpr double kStepToldM = 1.0;
constexpr double kSettledM = 1e-6;
constexpr int kMostSweeps = 10'000;

/// Of one track by itself, from 0 on.
std::vector<GradePoint> profile_of(const NetTrack& track) {
  const double length_m = track.track.alignment.length_m();
  const double scale = length_m / track.length_m;
  std::vector<GradePoint> profile{{0, 0, 0}};
  double grade = 0;
  const auto reach = [&](double offset_m, double curve_length_m) {
    const GradePoint last = profile.back();
    const double height_m = last.elevation_m + grade * (offset_m - last.offset_m);
    if (offset_m > last.offset_m) profile.push_back({offset_m, height_m, curve_length_m});
  };
  for (const NetSlope& slope : track.slopes) {
    reach(std::clamp(slope.offset_m, 0.0, track.length_m) * scale, slope.curve_length_m * scale);
    grade = slope.grade;
  }
  reach(length_m, 0);
  return profile;
}

class Heights {
 public:
  Heights(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes) : net_(net), nodes_(nodes) {
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
    return std::move(profiles_);
  }

 private:
  [[nodiscard]] bool has_slopes(size_t track) const { return !net_.tracks[track].slopes.empty(); }
  [[nodiscard]] double length(size_t track) const { return net_.tracks[track].track.alignment.length_m(); }
  [[nodiscard]] double climb(size_t track) const {
    return height_at_.at(nodes_[track].second) - height_at_.at(nodes_[track].first);
  }

  /// Tracks with slopes first: what is level for want of them must not set a height that slopes say.
  void spread() {
    std::deque<size_t> waiting;
    std::vector<bool> done(profiles_.size(), false);
    const auto go = [&] {
      while (!waiting.empty()) {
        const size_t track = waiting.front();
        waiting.pop_front();
        if (done[track]) continue;
        done[track] = true;
        set_heights(track);
        for (const size_t node : {nodes_[track].first, nodes_[track].second}) {
          for (const size_t next : tracks_at_[node])
            has_slopes(next) ? waiting.push_front(next) : waiting.push_back(next);
        }
      }
    };
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

  /// Between tracks without slopes the height is the one that lets all of them climb evenly.
  void settle() {
    std::vector<size_t> open;
    for (const auto& [node, tracks] : tracks_at_) {
      if (std::none_of(tracks.begin(), tracks.end(), [&](size_t track) { return has_slopes(track); }))
        open.push_back(node);
    }
    double moved_m = 2 * kSettledM;
    for (int sweep = 0; sweep < kMostSweeps && moved_m > kSettledM; ++sweep) {
      moved_m = 0;
      for (const size_t node : open) {
        const double height_m = even_height(node);
        moved_m = std::max(moved_m, std::abs(height_m - height_at_[node]));
        height_at_[node] = height_m;
      }
    }
  }

  [[nodiscard]] double even_height(size_t node) {
    double sum = 0;
    double weight = 0;
    for (const size_t track : tracks_at_[node]) {
      const auto [begin, end] = nodes_[track];
      sum += height_at_[begin == node ? end : begin] / length(track);
      weight += 1 / length(track);
    }
    return sum / weight;
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
    std::array<char, 64> heights{};
    std::snprintf(heights.data(), heights.size(), "%.2f m to %.2f m", begin_m, profile.back().elevation_m);
    net_.problems.push_back("track " + net_.tracks[track].track.name + " has no gradients; it climbs evenly from " +
                            heights.data() + ", where others put its ends");
  }

  void tell_step(size_t track) {
    const double step_m = profiles_[track].back().elevation_m - height_at_[nodes_[track].second];
    if (std::abs(step_m) < kStepToldM) return;
    std::array<char, 32> step{};
    std::snprintf(step.data(), step.size(), "%.2f m", step_m);
    net_.problems.push_back("track " + net_.tracks[track].track.name + " ends " + step.data() +
                            " above where others put its end, by its gradients; heights step there");
  }

  RailNet& net_;
  const std::vector<std::pair<size_t, size_t>>& nodes_;
  std::vector<std::vector<GradePoint>> profiles_;
  std::map<size_t, std::vector<size_t>> tracks_at_;  // nodes
  std::map<size_t, double> height_at_;               // nodes
};

}  // namespace

std::vector<std::vector<GradePoint>> net_profiles(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes) {
  if (std::all_of(net.tracks.begin(), net.tracks.end(), [](const NetTrack& track) { return track.slopes.empty(); }))
    return std::vector<std::vector<GradePoint>>(net.tracks.size());
  return Heights(net, nodes).make();
}

}  // namespace railfix::track
