// Natural reference points surveyed from recorded runs: what several passes saw at the same place becomes a landmark.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/result.hpp"
#include "track/map.hpp"

namespace railfix::tool {

/// One sighting, put on the map by where the run thought it was.
struct SurveySighting {
  size_t run = 0;
  double way_m = 0;  // of the run at the sighting, by its speed: no fix moves it
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  uint32_t edge = 0;
  double offset_m = 0;
  double lateral_m = 0;
  double sigma_m = 0;        // of the sighting
  double run_sigma_m = 0;    // of the run's place, shared by sightings near each other
  double place_ahead_m = 0;  // the run's place along the track minus way_m: what its fixes have moved it
  bool is_reverse = false;   // the run goes against the edge
  size_t stretch = 0;        // of the run: way_m says nothing from one to the next

  /// Along the edge, as if no fix had moved the run's place.
  [[nodiscard]] double unmoved_m() const { return offset_m + (is_reverse ? place_ahead_m : -place_ahead_m); }
};

struct SurveyOptions {
  double stretch_m = 500;     // of a run: its place counts once in it at most, fixes near each other share their errors
  double knot_m = 100;        // the error of way_m is linear between knots so far apart ...
  double drift = 0.002;       // ... and changes by this share of the way (1 sigma)
  double common_share = 0.5;  // of a sighting's variance that all sightings of a thing have in common
  double gate_m = 4;          // sightings of one kind nearer than this along the track are of one thing
  size_t least_runs = 2;      // a new landmark must have been seen in as many
};

struct SurveyedLandmark {
  uint32_t known_id = 0;  // of the map, 0 = new
  track::Landmark landmark;
  size_t sightings = 0;
  size_t runs = 0;
  double moved_m = 0;     // against the map
  size_t runs_apart = 0;  // that see it elsewhere than the map has it, beyond 3 sigmas; 0 where they agree ...
  double apart_m = 0;     // ... and how far along its edge
};

struct Survey {
  std::vector<SurveyedLandmark> landmarks;
  size_t sightings = 0;
  size_t outliers = 0;    // sightings that hardly counted
  size_t left_alone = 0;  // sightings of things that too few runs saw
  double spread = 0;      // rms of errors over their sigmas; sigmas are widened where it is above 1
};

/// All sightings of a thing err alike to some part, which would come in once more: on a map that has learnt before the
/// known landmarks stay as they are, and only new ones are found.
inline bool known_ones_stay(const track::Map& map) {
  return !map.learnt_runs.empty();
}

/// Track that a run passed with its camera before it: what stands there it could have seen.
struct PassedTrack {
  size_t run = 0;
  uint32_t edge = 0;
  double from_m = 0;
  double to_m = 0;
};

/// Robust least squares (Huber) over landmarks and the error of every run's way; landmarks of the map enter with their
/// sigma. What the camera sees wrongly in the same way every time does not average out: see common_share.
Survey survey_landmarks(const track::Map& map, const std::vector<SurveySighting>& sightings,
                        const SurveyOptions& options);

/// Moves the known landmarks and adds the new ones.
void apply_survey(const Survey& survey, track::Map& map);

/// Known landmarks of kinds that the runs sighted, which none of the `least_runs` or more that passed them saw.
struct UnseenLandmark {
  const track::Landmark* known = nullptr;
  size_t runs = 0;  // that passed it
};
std::vector<UnseenLandmark> unseen_landmarks(const track::Map& map, const Survey& survey,
                                             const std::vector<SurveySighting>& sightings,
                                             const std::vector<PassedTrack>& passed, size_t least_runs);

inline constexpr double kLeastConfidence = 0.88;  // of a sighting: as the track_detector reports them by default

struct ReadSightings {
  std::vector<SurveySighting> placed;
  size_t placeless = 0;           // left out: the place was not known there, or nothing of the map lies there
  size_t doubtful = 0;            // left out: less confident, or of a kind that no camera tells
  std::vector<std::string> runs;  // that have sightings, by their content, for Map::learnt_runs
  std::vector<PassedTrack> passed;
  std::vector<size_t> never_confirmed;  // runs whose place was only told, all the way
};

/// Sightings of a run's tables (sightings.csv, train_state.csv).
core::Result<ReadSightings> read_sightings(const std::shared_ptr<const track::Map>& map,
                                           const std::filesystem::path& run_folder, size_t run);

/// Those of several runs. An error where sightings would count twice: a folder, a copy or a part of it given again, or
/// a run that the map has learnt from.
core::Result<ReadSightings> read_runs(const std::shared_ptr<const track::Map>& map,
                                      const std::vector<std::filesystem::path>& run_folders);

}  // namespace railfix::tool
