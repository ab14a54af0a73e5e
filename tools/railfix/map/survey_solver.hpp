// The least squares of a survey: things along edges, and the errors of the runs that saw them.
//
// A run that goes along its edge sees thing x at offset_m = x + c_x - b(way_m) + place_ahead_m + noise (all but x with
// the other sign against the edge): c_x is what all sightings of x have wrong in common, b the true place along the
// track minus way_m, a random walk with knots. Landmarks of the map hold x, the run's own place holds b.
#pragma once

#include <Eigen/SparseCholesky>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "map/survey.hpp"

namespace railfix::tool {

/// Sightings (by index) that are of one thing.
struct Thing {
  const track::Landmark* known = nullptr;  // on the map as
  std::vector<size_t> sightings;
  bool is_apart = false;  // the runs see it elsewhere: what the map knows of its place does not count
};

struct PlaceEstimate {
  double place_m = 0;
  double sigma_m = 0;
};

class SurveySolver {
 public:
  static constexpr double kHuber = 2.0;  // sigmas beyond which a sighting loses weight

  /// Solves. REQUIRES: every sighting of a thing is in `all`, which outlives the solver as do the things.
  SurveySolver(const std::vector<SurveySighting>& all, const std::vector<Thing>& things, const SurveyOptions& options);

  [[nodiscard]] double place(size_t thing) const { return state_[place_index(thing)]; }
  [[nodiscard]] double sigma(size_t thing) const;
  /// What the runs alone say of a thing that the map knows; nothing where they say next to nothing.
  [[nodiscard]] std::optional<PlaceEstimate> seen_place(size_t thing) const;
  /// Along its edge, with the error of its run's way taken out.
  [[nodiscard]] double seen_at(size_t sighting) const;
  /// Error of a sighting over the part of its sigma that it has alone.
  [[nodiscard]] double error(size_t thing, size_t sighting) const;

 private:
  using Terms = std::vector<std::pair<Eigen::Index, double>>;
  using Knot = std::tuple<size_t, size_t, int64_t>;  // of run, stretch and number along its way

  [[nodiscard]] static Eigen::Index place_index(size_t thing) { return static_cast<Eigen::Index>(thing); }
  [[nodiscard]] Eigen::Index common_index(size_t thing) const {
    return static_cast<Eigen::Index>(things_.size() + thing);
  }
  /// What a run knew of its place along so much of its way.
  struct ToldPlace {
    size_t sighting = 0;  // the one with the vaguest place
    double begin_m = 0;   // of the run's way
    double length_m = 0;
    double runs = 1;  // that pass there
  };

  [[nodiscard]] Terms terms_of(size_t thing, size_t sighting) const;
  /// b(way_m) along the edge.
  [[nodiscard]] Terms way_terms(size_t sighting, double sign) const;
  [[nodiscard]] double own_sigma(size_t sighting) const;
  /// The one before a sighting (0) and the one behind it (1).
  [[nodiscard]] Knot knot_of(const SurveySighting& seen, int64_t side) const;
  [[nodiscard]] double told_anew_after_m(double run_sigma_m) const;
  [[nodiscard]] std::vector<ToldPlace> told_places() const;
  [[nodiscard]] size_t runs_along(const ToldPlace& told) const;
  void solve();
  /// terms * state = value with this weight.
  void add(const Terms& terms, double value, double weight);
  void add_sightings();
  void add_knots();
  void add_places_of_runs();

  const std::vector<SurveySighting>& all_;
  const std::vector<Thing>& things_;
  SurveyOptions options_;
  std::map<Knot, Eigen::Index> knots_;
  std::vector<ToldPlace> told_;
  Eigen::VectorXd state_;
  std::vector<Eigen::Triplet<double>> normal_;
  Eigen::VectorXd right_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace railfix::tool
