// How the world and the windscreen look in one picture: light and weather of its moment.
#pragma once

namespace railfix::simulator {

/// Light of the open line. A diffuse day of sky 1 and no sun is the measure: it lights albedo 1 to full white.
struct Light {
  double sky = 1.0;   // from everywhere, no shadows
  double dome = 1.0;  // brightness of the sky that the camera sees
  double sun = 0.0;   // from the sun, where nothing is in its way
  double sun_elevation_rad = 0.6;
  double sun_heading_rad = 0.0;  // where it stands, clockwise from grid north
  double headlamp = 1.0;         // of the train; it shows where the rest is dark
  double haze_m = 500.0;         // things so far away are lost in it
};

/// Strengths from 0 (none) to 1 (as RenderOptions::weather says) where nothing else is said.
struct Look {
  Light light;
  double time_s = 0;   // since the beginning, for what moves by itself
  double shadows = 0;  // share of the sun's light that trees or clouds take
  double wet = 0;      // ground and rails
  double rain = 0;     // drops in the air
  double leaves = 0;   // in the air
  double drops = 0;    // on the windscreen
  double dirt = 0;
  bool wiping = false;
};

}  // namespace railfix::simulator
