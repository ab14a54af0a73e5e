#include "track/import/fit/curvature_profile.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr double kKnotM = 15.0;       // knots are no nearer
constexpr double kSparseM = 50.0;     // between points farther apart there are knots too, ...
constexpr size_t kMostExtra = 3;      // ... so many
constexpr double kDoneSigmas = 1e-3;  // of the largest change
constexpr double kSlopeSigma = 1e-4;  // change of the curvature's rate at a knot, per metre squared
constexpr int kProfileSteps = 6;
constexpr double kWald = 25.0;  // five sigma: chosen on made-up lines

/// Knots on the chords, curvature from the turn at every point.
CurvatureProfile first_guess(const CurvatureTarget& target) {
  const std::vector<Eigen::Vector2d>& points = target.points;
  CurvatureProfile out;
  const double first = heading_of(points[1] - points[0]);
  out.start = {points[0].x(), points[0].y(), target.heading_at_start.value_or(first)};
  std::vector<double> along{0};
  std::vector<double> heading;  // of each chord, counted on over full turns
  for (size_t i = 0; i + 1 < points.size(); ++i) {
    const Eigen::Vector2d step = points[i + 1] - points[i];
    along.push_back(along.back() + step.norm());
    heading.push_back(i == 0 ? first : heading.back() + core::wrap_pi(heading_of(step) - heading.back()));
  }
  const double length = along.back();
  out.at_m.push_back(0);
  for (size_t i = 1; i < along.size(); ++i) {
    const double gap = along[i] - out.at_m.back();
    const auto extra = std::min(static_cast<size_t>(gap / kSparseM), kMostExtra);
    const double from = out.at_m.back();
    for (size_t k = 1; k <= extra; ++k)
      out.at_m.push_back(from + gap * static_cast<double>(k) / static_cast<double>(extra + 1));
    if (along[i] - out.at_m.back() >= kKnotM && length - along[i] >= kKnotM) out.at_m.push_back(along[i]);
  }
  if (length - out.at_m.back() < 0.5 * kKnotM && out.at_m.size() > 1) out.at_m.pop_back();
  out.at_m.push_back(length);
  // The turn of the chords' headings between the middles of a knot's two spans.
  const auto heading_at = [&](double s) {
    const auto after = std::upper_bound(along.begin(), along.end(), s) - along.begin();
    const auto chord =
        static_cast<size_t>(std::clamp<ptrdiff_t>(after - 1, 0, static_cast<ptrdiff_t>(heading.size()) - 1));
    return heading[chord];
  };
  for (size_t i = 0; i < out.at_m.size(); ++i) {
    const double from = i == 0 ? 0.0 : 0.5 * (out.at_m[i - 1] + out.at_m[i]);
    const double to = i + 1 == out.at_m.size() ? length : 0.5 * (out.at_m[i] + out.at_m[i + 1]);
    out.curvature.push_back(-(heading_at(to) - heading_at(from)) / std::max(to - from, 1.0));
  }
  return out;
}

/// Rows of the least squares problem around a profile: unknown are the heading at the start (to the left) and the
/// curvatures.
class Problem {
 public:
  Problem(const CurvatureTarget& target, const CurvatureProfile& profile) : target_(target), profile_(profile) {
    const auto count = static_cast<Eigen::Index>(profile.at_m.size() + 1);
    rows_ = Eigen::MatrixXd::Zero(count + static_cast<Eigen::Index>(target.points.size()) + 2, count);
    residual_ = Eigen::VectorXd::Zero(rows_.rows());
    add_points();
    add_headings();
    add_prior();
  }

  /// Least squares change, and its covariance. By QR with columns of one size: end points known to a millimetre and
  /// curvatures that act over kilometres are too much for normal equations.
  [[nodiscard]] Eigen::VectorXd solve(Eigen::MatrixXd& covariance) {
    const Eigen::VectorXd scale = rows_.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    const Eigen::HouseholderQR<Eigen::MatrixXd> solver(rows_ * scale.asDiagonal());
    const auto upper = solver.matrixQR().topRows(rows_.cols()).triangularView<Eigen::Upper>();
    const Eigen::VectorXd right = (solver.householderQ().adjoint() * residual_).head(rows_.cols());
    Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(rows_.cols(), rows_.cols());
    upper.solveInPlace(inverse);
    inverse = scale.asDiagonal() * inverse;
    covariance.noalias() = inverse * inverse.transpose();
    return inverse * right;
  }

 private:
  void add_row(const Eigen::VectorXd& row, double residual, double sigma) {
    rows_.row(next_) = row / sigma;
    residual_[next_++] = residual / sigma;
  }

  /// How much the heading turns for one unit of curvature at a knot.
  [[nodiscard]] double area(size_t knot) const {
    const double before = knot == 0 ? 0.0 : profile_.at_m[knot] - profile_.at_m[knot - 1];
    const double after = knot + 1 == profile_.at_m.size() ? 0.0 : profile_.at_m[knot + 1] - profile_.at_m[knot];
    return 0.5 * (before + after);
  }

  void add_points() {
    const Alignment track = profile_.alignment();
    const std::vector<double> stations = stations_of(track, target_.points);
    const Eigen::VectorXd off = distances_of(track, target_.points, stations);
    std::vector<Eigen::Vector2d> knots;
    for (const double s : profile_.at_m) {
      const PlanPose pose = track.at(s).pose;
      knots.emplace_back(pose.easting_m, pose.northing_m);
    }
    Eigen::VectorXd row(rows_.cols());
    for (size_t k = 1; k < target_.points.size(); ++k) {
      const PlanPose pose = track.at(stations[k]).pose;
      const Eigen::Vector2d here(pose.easting_m, pose.northing_m);
      const Eigen::Vector2d along = direction_of(pose.heading_rad);
      row.setZero();
      row[0] = (here - knots[0]).dot(along);
      for (size_t i = 0; i < knots.size() && profile_.at_m[i] < stations[k]; ++i)
        row[static_cast<Eigen::Index>(i + 1)] = area(i) * (here - knots[i]).dot(along);
      const bool is_last = k + 1 == target_.points.size();
      add_row(row, off[static_cast<Eigen::Index>(k)], is_last ? kExactM : target_.sigma_m);
    }
  }

  void add_headings() {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(rows_.cols());
    row[0] = 1;
    if (target_.heading_at_start)
      add_row(row, core::wrap_pi(profile_.start.heading_rad - *target_.heading_at_start), kExactRad);
    if (!target_.heading_at_end) return;
    double turned = 0;
    for (size_t i = 0; i < profile_.at_m.size(); ++i) {
      row[static_cast<Eigen::Index>(i + 1)] = area(i);
      turned += area(i) * profile_.curvature[i];
    }
    const double heading = profile_.start.heading_rad - turned;
    add_row(row, core::wrap_pi(heading - *target_.heading_at_end), kExactRad);
  }

  void add_prior() {
    Eigen::VectorXd row(rows_.cols());
    for (size_t i = 0; i < profile_.at_m.size(); ++i) {
      row.setZero();
      const auto at = static_cast<Eigen::Index>(i + 1);
      double value = 0;
      double sigma = kSlopeSigma;
      if (i == 0 || i + 1 == profile_.at_m.size()) {
        row[at] = 1;
        sigma = 0.02;  // no radius below 50 m
        value = profile_.curvature[i];
      } else {
        const double before = 1.0 / (profile_.at_m[i] - profile_.at_m[i - 1]);
        const double after = 1.0 / (profile_.at_m[i + 1] - profile_.at_m[i]);
        row[at - 1] = before;
        row[at] = -before - after;
        row[at + 1] = after;
        value = before * profile_.curvature[i - 1] - (before + after) * profile_.curvature[i] +
                after * profile_.curvature[i + 1];
      }
      add_row(row, -value, sigma);
    }
  }

  const CurvatureTarget& target_;
  const CurvatureProfile& profile_;
  Eigen::MatrixXd rows_;
  Eigen::VectorXd residual_;
  Eigen::Index next_ = 0;
};

/// Takes away what the points do not call for, the least first.
class Simplifier {
 public:
  Simplifier(const CurvatureProfile& profile, Eigen::MatrixXd covariance)
      : profile_(profile), covariance_(std::move(covariance)) {
    state_.resize(static_cast<Eigen::Index>(profile.at_m.size() + 1));
    state_[0] = 0;
    for (size_t i = 0; i < profile.curvature.size(); ++i) {
      state_[index(i)] = profile.curvature[i];
      active_.push_back(i);
      group_.push_back(i + 1);
    }
  }

  SparseProfile run() {
    while (const std::optional<Change> change = least()) {
      restrict_to(change->terms, change->constant());
      apply(*change);
    }
    SparseProfile out;
    out.start = profile_.start;
    out.start.heading_rad -= state_[0];
    out.values.assign(1, 0.0);
    std::vector<size_t> number(group_.size() + 1, 0);
    for (const size_t knot : active_) {
      const size_t group = group_[knot];
      if (group != 0 && number[group] == 0) {
        number[group] = out.values.size();
        out.values.push_back(state_[index(knot)]);
      }
      out.at_m.push_back(profile_.at_m[knot]);
      out.value.push_back(number[group]);
    }
    return out;
  }

 private:
  struct Term {
    Eigen::Index index = 0;
    double factor = 0;
  };
  enum class Kind { remove, equal, zero };
  struct Change {
    Kind kind = Kind::remove;
    size_t place = 0;  // in active_
    std::vector<Term> terms;
    double wald = 0;
    double value = 0;
    [[nodiscard]] double constant() const { return value; }
  };

  [[nodiscard]] static Eigen::Index index(size_t knot) { return static_cast<Eigen::Index>(knot + 1); }

  void consider(Change change, std::optional<Change>& best) const {
    double value = 0;
    double variance = 0;
    for (const Term& a : change.terms) {
      value += a.factor * state_[a.index];
      for (const Term& b : change.terms) variance += a.factor * b.factor * covariance_(a.index, b.index);
    }
    change.value = value;
    // Where nothing is left to restrict, the change is free.
    change.wald = variance > 1e-20 ? value * value / variance : 0.0;
    if (change.wald < kWald && (!best || change.wald < best->wald)) best = std::move(change);
  }

  [[nodiscard]] std::optional<Change> least() const {
    std::optional<Change> best;
    for (size_t p = 0; p < active_.size(); ++p) {
      const size_t knot = active_[p];
      if (p > 0 && p + 1 < active_.size()) consider_removal(p, best);
      if (group_[knot] != 0) consider({Kind::zero, p, {{index(knot), 1}}}, best);
      if (p + 1 < active_.size() && group_[knot] != group_[active_[p + 1]])
        consider({Kind::equal, p, {{index(knot), 1}, {index(active_[p + 1]), -1}}}, best);
    }
    return best;
  }

  void consider_removal(size_t p, std::optional<Change>& best) const {
    const size_t before = active_[p - 1];
    const size_t knot = active_[p];
    const size_t after = active_[p + 1];
    const bool is_plain = group_[knot] == group_[before] && group_[knot] == group_[after];
    const bool is_held = group_[knot] == 0 || group_[knot] == group_[before] || group_[knot] == group_[after];
    if (is_held && !is_plain) return;
    const double part = (profile_.at_m[knot] - profile_.at_m[before]) / (profile_.at_m[after] - profile_.at_m[before]);
    consider({Kind::remove, p, {{index(before), 1 - part}, {index(knot), -1}, {index(after), part}}}, best);
  }

  /// The estimate under one more linear restriction.
  void restrict_to(const std::vector<Term>& terms, double value) {
    Eigen::VectorXd gain = Eigen::VectorXd::Zero(state_.size());
    for (const Term& term : terms) gain += term.factor * covariance_.col(term.index);
    double variance = 0;
    for (const Term& term : terms) variance += term.factor * gain[term.index];
    if (variance < 1e-20) return;
    state_ -= gain * (value / variance);
    covariance_.noalias() -= gain * (gain.transpose() / variance);
  }

  void apply(const Change& change) {
    const size_t knot = active_[change.place];
    if (change.kind == Kind::remove) {
      active_.erase(active_.begin() + static_cast<ptrdiff_t>(change.place));
      return;
    }
    const size_t from = change.kind == Kind::zero ? group_[knot] : group_[active_[change.place + 1]];
    const size_t to = change.kind == Kind::zero ? 0 : group_[knot];
    const size_t keep = std::min(from, to);  // zero wins
    for (size_t& group : group_) {
      if (group == from || group == to) group = keep;
    }
  }

  const CurvatureProfile& profile_;
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd state_;
  std::vector<size_t> active_;
  std::vector<size_t> group_;
};

}  // namespace

bool CurvatureProfile::is_plausible() const {
  return std::all_of(curvature.begin(), curvature.end(), [](double c) { return std::abs(c) < 0.1; });
}

Alignment CurvatureProfile::alignment() const {
  std::vector<Element> elements;
  for (size_t i = 0; i + 1 < at_m.size(); ++i)
    elements.push_back({at_m[i + 1] - at_m[i], curvature[i], curvature[i + 1]});
  return Alignment::chained(start, std::move(elements));
}

CurvatureProfile SparseProfile::dense() const {
  CurvatureProfile out{start, at_m, {}};
  for (const size_t number : value) out.curvature.push_back(values[number]);
  return out;
}

std::vector<double> stations_of(const Alignment& track, const std::vector<Eigen::Vector2d>& points) {
  std::vector<double> out;
  double reached = 0;
  for (const Eigen::Vector2d& point : points) {
    // Newton from where the point before was: a track may come near itself again.
    double s = reached + (out.empty() ? 0.0 : (point - points[out.size() - 1]).norm());
    for (int step = 0; step < 20; ++step) {
      const TrackPoint at = track.at(s);
      const Eigen::Vector2d away = point - Eigen::Vector2d(at.pose.easting_m, at.pose.northing_m);
      const double ahead = away.x() * std::sin(at.pose.heading_rad) + away.y() * std::cos(at.pose.heading_rad);
      s += std::clamp(ahead, -50.0, 50.0);
      if (std::abs(ahead) < 1e-6) break;
    }
    if (out.empty()) s = 0;
    out.push_back(s);
    reached = s;
  }
  return out;
}

Eigen::VectorXd distances_of(const Alignment& track, const std::vector<Eigen::Vector2d>& points,
                             const std::vector<double>& stations) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    const PlanPose pose = track.at(stations[i]).pose;
    const Eigen::Vector2d away = points[i] - Eigen::Vector2d(pose.easting_m, pose.northing_m);
    out[static_cast<Eigen::Index>(i)] = away.y() * std::sin(pose.heading_rad) - away.x() * std::cos(pose.heading_rad);
  }
  return out;
}

CurvatureProfile dense_profile(const CurvatureTarget& target, Eigen::MatrixXd& covariance) {
  CurvatureProfile profile = first_guess(target);
  for (int step = 0; step < kProfileSteps; ++step) {
    const Eigen::VectorXd change = Problem(target, profile).solve(covariance);
    if (!change.allFinite()) break;
    profile.start.heading_rad -= change[0];
    for (size_t i = 0; i < profile.curvature.size(); ++i)
      profile.curvature[i] += change[static_cast<Eigen::Index>(i + 1)];
    // No track; and curves that wind up take ages to follow.
    if (!profile.is_plausible()) break;
    if ((change.array().square() < kDoneSigmas * kDoneSigmas * covariance.diagonal().array()).all()) break;
  }
  return profile;
}

SparseProfile simplified(const CurvatureProfile& profile, Eigen::MatrixXd covariance) {
  return Simplifier(profile, std::move(covariance)).run();
}

}  // namespace railfix::track
