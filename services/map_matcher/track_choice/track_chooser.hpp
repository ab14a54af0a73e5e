// Which track? Every way through the switches around the train is a hypothesis with a probability. How the train turns
// against the curvature of each way, how the rails in the picture bend, the side of the frogs and what was sighted tell
// them apart; until one is clearly ahead the track is not yet known.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "map_matcher/track_choice/track_parameters.hpp"
#include "map_matcher/track_choice/turn_cells.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

/// Where fusion thinks the train is: an edge, and how far it may be off along the track.
struct TrackWindow {
  track::EdgePosition place;
  double over_m = 0;  // may be so far behind
  double under_m = 0;
  double sigma_m = 0;
  double probability = 1;  // of this edge, as long as nothing is known here
  bool forwards = true;    // the train moves the way that the cab looks
  bool stands = false;     // or creeps: which way it came is not known
};

struct TrackOption {
  track::EdgePosition place;
  double probability = 0;
};

/// Tracks best first; their probabilities add up to 1, or to less when the train may be on another track that is not
/// looked into.
struct TrackChoice {
  std::vector<TrackOption> options;
  std::vector<TrackOption> elsewhere;  // on the best track, furthest to either side: ways of another length led there
  bool known = false;
};

class TrackChooser {
 public:
  TrackChooser(const TrackParameters& parameters, std::shared_ptr<const track::Map> map,
               std::shared_ptr<const track::Ways> ways)
      : parameters_(parameters), map_(std::move(map)), ways_(std::move(ways)) {}

  /// REQUIRES: the edge is on the map. The first window starts the hypotheses, later ones move them along.
  void follow(const TrackWindow& window);
  /// Moved and turned; the way in metres of the map as well as known, signed.
  void move(const Turn& turn);
  /// Stood, and the sensor says that it turned: its own error.
  void stand(const Turn& turn);
  /// Moved, but nobody knows how it turned.
  void move_blind(double way_m);
  void sight(const Sighting& sighting);
  /// The curvature of the rails in a picture taken here (left positive).
  void see(double curvature_per_m, double sigma_per_m);
  /// Nothing before the first window, and where each of several ways has ended.
  [[nodiscard]] std::optional<TrackChoice> choice() const;
  /// How probable it is that the train runs over this landmark, or over one that is alike at the same place of another
  /// way; 1 where no way has it, or there is but one.
  [[nodiscard]] double share_of(const track::Landmark& landmark) const;
  /// Whose turning was used last.
  [[nodiscard]] TurnSensor sensor() const { return sensor_; }

 private:
  /// What the pictures showed: their errors are not independent, since a detector that follows the other leg goes on to
  /// do so and sees that leg's frog. So a hidden state (own leg or astray) is carried along, as logarithms.
  struct Pictures {
    double own = 0;
    double astray = 0;
  };
  struct Hypothesis {
    track::Route route;
    double log_prior = 0;  // ways taken
    Pictures pictures;
    std::vector<TurnCell> cells;
  };
  void start(const TrackWindow& window);
  void open_ways_behind();
  /// Of the switches that a train came over which runs on that way: where it may be instead.
  struct OtherLegs {
    std::vector<track::Route> routes;
    double probability = 1;    // that it is on none of them
    bool of_one_near = false;  // a switch that it may stand in front of
  };
  [[nodiscard]] OtherLegs other_legs(bool forwards) const;
  void run(double way_m);
  void use_pending();
  void watch_for_jump(const BinTurn& bin);
  void fit_cells();
  void turn_round();
  void extend();
  void extend_behind(track::Route& route);
  void guess_nothing();
  [[nodiscard]] bool on_guess() const;
  void trim();
  /// False before the first window.
  [[nodiscard]] bool stands_near(const track::EdgePosition& place) const;
  static void join(Hypothesis& into, const Hypothesis& other);
  void merge();
  void prune();
  void use_picture(const std::vector<double>& log_fits);
  /// No two ways have rails in common there.
  [[nodiscard]] bool are_apart_at(double at_m) const;
  /// Of what lies between the rails that the train runs on.
  void use_sure(const std::vector<double>& log_fits);
  void run_pictures(double way_m);
  /// A track where the train may be: the places there, best first, and the probability of them all.
  struct WeighedTrack {
    std::vector<TrackOption> places;
    double probability = 0;
  };
  /// Best first; nothing where each of several ways has ended.
  [[nodiscard]] std::vector<WeighedTrack> weigh_tracks() const;
  /// Logarithm of prior and all evidence.
  [[nodiscard]] double evidence(const Hypothesis& hypothesis) const;
  [[nodiscard]] double of_turning(const Hypothesis& hypothesis) const;
  [[nodiscard]] double log_of_place(double place_m) const;
  [[nodiscard]] double first_m() const { return place_m_ - window_.over_m - parameters_.lag_m - 2; }
  [[nodiscard]] double last_m() const { return place_m_ + window_.under_m + 2; }

  TrackParameters parameters_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Ways> ways_;
  std::vector<Hypothesis> hypotheses_;
  TrackWindow window_;
  double place_m_ = 0;  // of the window's middle on the routes
  double cells_m_ = 0;  // of the first cell
  double lost_m_ = 0;   // run since the window was on one of the routes
  double moved_back_m_ = 0;
  double guessed_m_ = -INFINITY;  // behind this place the routes are the straight ones, whatever the train came by
  bool forwards_ = true;          // the way that the train moves, seen from the cab
  double seen_m_ = INFINITY;      // run since a picture was used
  double told_ = 1;               // probability of what was told at the start and cannot be looked into
  std::optional<double> sure_m_;  // on the routes, what was sighted below the train last
  TurnSensor sensor_ = TurnSensor::camera;
  double watched_s_ = INFINITY;  // since the sensor's bias may have jumped last
  double watched_m_ = 0;
  BinTurn pending_;
};

}  // namespace railfix::map_matcher
