// What the choice of a landmark takes for granted of sightings, map and odometer.
#pragma once

namespace railfix::map_matcher {

struct LandmarkParameters {
  double detection = 0.8;        // chance that a mapped landmark is sighted
  double false_per_m = 0.0005;   // false sightings of one kind per metre, where the map has all of them
  double moved = 0.03;           // chance that a landmark stands elsewhere than the map says, ...
  double moved_m = 6.0;          // ... by so much at most
  double elsewhere = 1e-3;       // chance that the train is not in the window: somebody has told its start wrongly
  double scale_sigma = 0.01;     // of the distance run between sightings
  double window_margin_m = 2.0;  // beyond the promised interval of train_state
  double history_m = 600;        // sightings are judged together over this way
  double min_probability = 0.5;  // of a fix that is worth sending
};

}  // namespace railfix::map_matcher
