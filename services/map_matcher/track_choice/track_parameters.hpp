// What the choice of the track takes for granted of sensors, map and car.
#pragma once

namespace railfix::map_matcher {

struct TrackParameters {
  double bin_m = 2.0;             // turning is compared over this way
  double noise_per_m = 2e-4;      // least sigma of the curvature of one bin: sleepers, hunting
  double sway_rad = 3e-3;         // the body turns to and fro on its springs, one sigma at 72 km/h, ...
  double sway_s = 0.3;            // ... and forgets it in about this time
  double curvature_share = 0.15;  // of the map's curvature: switches are drawn roughly
  double correlated_bins = 3.0;   // the map's error, and that of pictures, is the same in so many bins
  double lag_m = 20.0;            // the car body turns up to so far behind the camera's foot (distance of the bogies)
  double map_sigma_m = 1.5;       // the map's switches are somewhere else by so much
  double reach_m = 30.0;          // ways are told apart from this far ahead
  double detection = 0.8;         // chance that a mapped landmark is sighted
  double false_per_m = 0.0005;    // false sightings of one kind per metre
  double wrong_side = 0.03;       // chance that a frog or mast is reported on the wrong side
  double view_from_m = 3.0;       // the curvature in a picture is that of the rails from here ...
  double view_to_m = 20.0;        // ... to here ahead of the camera's foot
  double astray = 0.15;           // chance that the picture's rails are those of another leg than the own
  double astray_m = 60.0;         // ... which then lasts about so far
};

}  // namespace railfix::map_matcher
