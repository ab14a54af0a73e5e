// Configuration of the map matcher: section `map_matcher`.
#pragma once

#include <string>

#include "map_matcher/map_matcher_parameters.hpp"
#include "service/config.hpp"

namespace railfix::map_matcher {

struct MapMatcherConfig {
  std::string map;
  bool use_imu = true;
  bool use_gnss = true;
  MapMatcherParameters parameters;

  [[nodiscard]] core::Status check() const {
    const auto& locator = parameters.search.locator;
    if (locator.window_m < locator.least_way_m) {
      return core::Error{
          "map_matcher.locator.window_m is less than least_way_m: no way would ever be long enough to be looked for"};
    }
    if (parameters.track.view_from_m >= parameters.track.view_to_m) {
      return core::Error{"map_matcher.track.view_from_m must be less than view_to_m"};
    }
    return {};
  }

  void describe(service::Fields& fields) {
    auto& p = parameters;
    fields.text("map", map, "Compiled map (railfix map build); empty = nothing is matched.");
    fields.flag("use_landmarks", p.use_landmarks, "Match landmark sightings.");
    fields.flag("use_curvature", p.use_curvature, "Match the shape of the track.");
    fields.choice("curve_method", p.curve_method, {"likelihood", "exits"},
                  "How: likelihood over the place, or the exits of curves (paper 004, section 8).");
    fields.flag("choose_track", p.choose_track, "Say which track the train is on behind switches.");
    fields.flag("use_imu", use_imu, "Take the turning from the gyro while the camera is blind (or there is none).");
    fields.number("camera_bias_per_m", p.camera_bias_per_m, {0, 0.01}, "1/m",
                  "Constant error of the camera's turning for the choice of the track, one sigma.");
    fields.flag("locate", p.locate, "Look for the place on the whole map while nobody knows it.");
    fields.number("locate_every_m", p.search.every_m, {20, 10000}, "m", "... once in this way.");
    fields.flag("use_gnss", use_gnss, "... where GNSS says it, too: the one track within 30 m of it.");
    fields.number("gnss_antenna_ahead_m", p.search.gnss.antenna_ahead_m, {-500, 500}, "m",
                  "GNSS antenna ahead of the camera's foot: the same as fusion.gnss_antenna_ahead_m.");
    fields.number("view_ahead_m", p.view_ahead_m, {0, 50}, "m",
                  "The curvature of track_view belongs to a point at most so far ahead of the camera's foot.");
    fields.number("view_rate_sigma_per_m2", p.view_rate_sigma_per_m2, {1e-7, 1e-2}, "1/m^2",
                  "Where in front of that it lies follows from its sigma and this: the same as "
                  "track_detector.limits.curvature_rate_per_m2.");
    fields.number("least_speed_mps", p.least_speed_mps, {0, 50}, "m/s",
                  "Slower, the turning says nothing of the track.");
    fields.number("lag_m", p.lag_m, {0, 60}, "m",
                  "The car body may turn so far behind the camera's foot (distance of the bogies).");
    fields.number("match_every_m", p.match_every_m, {0.5, 1000}, "m", "The shape is matched anew after this way.");
    fields.group("landmarks", "Matching of sightings.", [this](service::Fields& f) { describe_landmarks(f); });
    fields.group("curvature", "Matching of the track's shape.", [this](service::Fields& f) { describe_curvature(f); });
    fields.group("gyro", "Turning from the IMU.", [this](service::Fields& f) { describe_gyro(f); });
    fields.group("track", "Choice of the track behind switches.", [this](service::Fields& f) { describe_track(f); });
    fields.group("locator", "The place on the whole map, without a prior.",
                 [this](service::Fields& f) { describe_locator(f); });
  }

 private:
  void describe_landmarks(service::Fields& f) {
    auto& p = parameters.landmarks;
    f.number(
        "detection", p.detection, {0.01, 0.999}, "",
        "Chance that a mapped landmark is sighted; also for the choice of the track and the search on the whole map.");
    f.number("false_per_m", p.false_per_m, {1e-7, 1}, "1/m",
             "False sightings of one kind per metre. What the map lacks is learnt on the way.");
    f.number("moved", p.moved, {0, 0.5}, "", "Chance that a landmark stands elsewhere than the map says ...");
    f.number("moved_m", p.moved_m, {0.1, 100}, "m", "... by so much at most.");
    f.number("elsewhere", p.elsewhere, {0, 0.5}, "",
             "Chance that the train is not where train_state says: its start was told wrongly.");
    f.number("scale_sigma", p.scale_sigma, {1e-5, 0.2}, "", "Error of the way run between sightings.");
    f.number("window_margin_m", p.window_margin_m, {0, 1000}, "m", "Search beyond the interval of train_state.");
    f.number("history_m", p.history_m, {0, 10000}, "m", "Sightings are judged together over this way.");
    f.number("min_probability", p.min_probability, {0, 1}, "", "A less probable fix is not sent.");
  }
  void describe_curvature(service::Fields& f) {
    auto& p = parameters.curvature;
    f.number("bin_m", p.bin_m, {0.5, 50}, "m", "Measurements are averaged over this way.");
    f.number("window_m", p.window_m, {50, 5000}, "m", "Longest way that is matched.");
    f.number("noise_per_m", p.noise_per_m, {1e-6, 0.1}, "1/m", "Least sigma of one average.");
    f.number("correlated_bins", p.correlated_bins, {1, 100}, "", "So many neighbouring averages err together.");
    f.number("sway_rad", p.sway_rad, {0, 0.1}, "rad", "The body turns to and fro on its springs, one sigma ...");
    f.number("sway_m", p.sway_m, {0.1, 1000}, "m", "... and forgets it over about this way.");
    f.number("bias_per_m", p.bias_per_m, {1e-9, 0.01}, "1/m", "Constant error of the measured curvature, one sigma.");
    f.number("scale_sigma", p.scale_sigma, {1e-5, 0.2}, "", "Error of the odometer's scale.");
    f.number("search_margin_m", p.search_margin_m, {0, 1000}, "m", "Search beyond the interval of train_state.");
    f.number("max_sigma_m", p.max_sigma_m, {0.5, 100}, "m", "A vaguer fix is not sent.");
    f.number("sigma_floor_m", p.sigma_floor_m, {0, 50}, "m", "Least sigma of a fix.");
    f.number("min_probability", p.min_probability, {0, 1}, "", "A less probable fix is not sent.");
  }
  void describe_gyro(service::Fields& f) {
    auto& p = parameters.gyro;
    f.number("noise_rad", p.noise_rad, {1e-6, 0.1}, "rad", "Random walk of the heading in a second, one sigma.");
    f.number("bias_rps", p.bias_rps, {0, 0.1}, "rad/s", "Constant error before the train has stood, one sigma.");
    f.number("bias_walk_rps", p.bias_walk_rps, {0, 0.01}, "rad/s", "It wanders by so much in a second.");
    f.number("jump_rps", p.jump_rps, {0, 1}, "rad/s",
             "Constant error of a gyro that has failed, one sigma; 0: none fails.");
    f.number("longest_gap_s", p.longest_gap_s, {0.01, 2}, "s", "Samples further apart do not belong together.");
  }
  void describe_track(service::Fields& f) {
    auto& p = parameters.track;
    f.number("bin_m", p.bin_m, {0.5, 20}, "m", "Turning is compared over this way.");
    f.number("noise_per_m", p.noise_per_m, {1e-6, 0.1}, "1/m", "Least sigma of the curvature of one bin.");
    f.number("sway_rad", p.sway_rad, {0, 0.1}, "rad",
             "The body turns to and fro on its springs, one sigma at 72 km/h ...");
    f.number("sway_s", p.sway_s, {0.01, 10}, "s", "... and forgets it in about this time.");
    f.number("curvature_share", p.curvature_share, {0, 1}, "",
             "The map's curvature may be off by this share (switches are drawn roughly).");
    f.number("correlated_bins", p.correlated_bins, {1, 100}, "",
             "The map's error, and that of pictures, is the same in so many neighbouring bins.");
    f.number("map_sigma_m", p.map_sigma_m, {0.1, 50}, "m", "Switches are elsewhere than on the map, one sigma.");
    f.number("reach_m", p.reach_m, {5, 500}, "m", "Ways are told apart from this far ahead of the train.");
    f.number("wrong_side", p.wrong_side, {0.001, 0.5}, "", "Chance that a frog or mast is reported on the wrong side.");
    f.number("view_from_m", p.view_from_m, {0, 50}, "m",
             "The curvature of track_view is that of the rails from here ...");
    f.number("view_to_m", p.view_to_m, {1, 100}, "m", "... to here ahead of the camera's foot.");
    f.number("astray", p.astray, {0.001, 0.5}, "",
             "Chance that pictures show another leg of a switch than the own, rails and frog alike (2 of 14 real "
             "pictures).");
    f.number("astray_m", p.astray_m, {5, 1000}, "m", "... which then lasts so far.");
  }
  void describe_locator(service::Fields& f) {
    auto& p = parameters.search.locator;
    f.number("window_m", p.window_m, {1000, 50000}, "m", "Longest way that is looked for.");
    f.number("least_way_m", p.least_way_m, {800, 50000}, "m", "A shorter way is not looked for.");
    f.number("least_turn_rad", p.least_turn_rad, {0, 100}, "rad",
             "A way that bends less is not looked for (sum of all turns, left and right).");
    f.number("scale_range", p.scale_range, {0.001, 0.05}, "", "The odometer's scale may be off by so much.");
    f.number("noise_per_m", p.noise_per_m, {1e-6, 0.01}, "1/m", "Least sigma of the measured curvature over 20 m.");
    f.number("bias_per_m", p.bias_per_m, {1e-7, 0.01}, "1/m", "Constant error of the measured curvature, one sigma.");
    f.number("heading_sigma_rad", p.heading_sigma_rad, {1e-4, 0.1}, "rad",
             "The body's heading strays so far about the mapped track's (hunting, errors of the map) ...");
    f.number("heading_m", p.heading_m, {5, 1000}, "m", "... and changes over such a way.");
    f.number("curvature_share", p.curvature_share, {0, 0.5}, "", "The map's curvature may be off by this share.");
    f.number("correlated_bins", p.correlated_bins, {1, 100}, "", "So many neighbouring 20 m err together.");
    f.number("certain", p.certain, {0.5, 0.999999}, "", "From this probability on a place is certain ...");
    f.number("certain_misfit", p.certain_misfit, {0.5, 100}, "",
             "... where the way fits to so many sigmas squared in the mean (2 where much speaks for it),");
    f.number("certain_sigma_m", p.certain_sigma_m, {7, 1000}, "m", "... and its sigma along the track is less.");
  }
};

}  // namespace railfix::map_matcher
