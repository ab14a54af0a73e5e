// Section `simulator` of a scenario file.
#pragma once

#include "service/config.hpp"
#include "simulator/scenario.hpp"
#include "simulator/windscreen.hpp"

namespace railfix::simulator {

struct SimulatorConfig {
  ScenarioOptions scenario;
  RenderOptions render;
  ShakeOptions shake;

  void describe(service::Fields& fields) {
    fields.group("light", "Of the open line. 1 is a bright diffuse day.", [&](auto& f) { describe_light(f); });
    fields.group("shadows", "Of trees and clouds; there must be sun.", [&](auto& f) { describe_shadows(f); });
    fields.group("rain", "In the air and on the ground.", [&](auto& f) { describe_rain(f); });
    fields.group("leaves", "Falling.", [&](auto& f) {
      f.number("intensity", scenario.leaves.intensity, {0, 1}, "", "How many leaves are in the air.");
      f.text("when", scenario.leaves.when, kWhen);
    });
    fields.group("windscreen", "What is on the glass before the camera.", [&](auto& f) { describe_windscreen(f); });
    fields.group("exposure", "Of the camera.", [&](auto& f) { describe_exposure(f); });
    fields.group("lens", "Distortion, written into the calibration too.", [&](auto& f) { describe_lens(f); });
    fields.group("vibration", "Of the camera against the track. Grows with speed, none at standstill.",
                 [&](auto& f) { describe_vibration(f); });
    fields.group("frames", "Pictures that get lost, and stamps that are off.", [&](auto& f) { describe_frames(f); });
    fields.group("strip", "Draws a part of the picture only, for long runs.", [&](auto& f) {
      f.number("ahead_m", render.strip.ahead_m, {0, 200}, "m", "The own track so far ahead, the rest is grey; 0: all.");
      f.number("beside_m", render.strip.beside_m, {0.8, 20}, "m", "So far to each side of its middle.");
      f.number("whole_before_m", render.strip.whole_before_m, {0, 500}, "m",
               "The whole picture so far before a frog and a tunnel, and in it; 0: nowhere.");
    });
  }

 private:
  static constexpr const char* kWhen = "always, never, or stretches of time or way: 10..20 s, 300..450 m.";

  void describe_light(service::Fields& fields) {
    auto& light = scenario.light;
    fields.number("sky", light.sky, {0, 2}, "", "Light from the whole sky.");
    fields.number("dome", light.dome, {0, 2}, "", "Brightness of the sky in the picture.");
    fields.number("sun", light.sun, {0, 3}, "", "Light from the sun.");
    fields.number("sun_elevation_deg", light.sun_elevation_deg, {0, 90}, "deg", "Over the horizon.");
    fields.number("sun_heading_deg", light.sun_heading_deg, {0, 360}, "deg",
                  "Where it stands, clockwise from grid north; the built-in line begins at 63.");
    fields.text("sun_when", light.sun_when, kWhen);
    fields.number("headlamp", light.headlamp, {0, 10}, "", "Of the train. Shows where it is dark.");
    fields.number("haze_m", light.haze_m, {50, 1e5}, "m", "Things so far away are lost in haze.");
  }
  void describe_shadows(service::Fields& fields) {
    fields.number("depth", scenario.shadows.depth, {0, 1}, "", "Share of the sun's light that they take.");
    fields.text("when", scenario.shadows.when, kWhen);
    auto& shape = render.weather.shadows;
    fields.number("length_m", shape.length_m, {0.2, 200}, "m", "Of a shadow along the track: trees 2, clouds 60.");
    fields.number("softness", shape.softness, {0.01, 1}, "", "Of their edges.");
    fields.number("slant", shape.slant, {-3, 3}, "", "Metres along the track per metre to the left.");
    fields.number("speed_mps", shape.speed_mps, {-30, 30}, "m/s", "How fast they move along the track.");
  }
  void describe_rain(service::Fields& fields) {
    fields.number("intensity", scenario.rain.intensity, {0, 1}, "", "Drops in the air.");
    fields.text("when", scenario.rain.when, kWhen);
    fields.number("wet", scenario.rain.wet, {0, 1}, "", "How wet the ground is, whether it rains or not.");
  }
  void describe_windscreen(service::Fields& fields) {
    auto& glass = render.weather.glass;
    fields.number("drops", scenario.windscreen.drops, {0, 1}, "", "Drops on the glass.");
    fields.text("drops_when", scenario.windscreen.drops_when, kWhen);
    fields.number("dirt", scenario.windscreen.dirt, {0, 1}, "", "Fixed blurred spots.");
    fields.text("wiper_when", scenario.windscreen.wiper_when, kWhen);
    fields.number("wiper_period_s", glass.wiper_period_s, {0.8, 60}, "s", "From wipe to wipe, there and back.");
    fields.number("wiper_sweep_s", glass.wiper_sweep_s, {0.2, 5}, "s", "One way over the glass.");
    fields.number("wiper_width", glass.wiper_width, {0.005, 0.2}, "",
                  "Of the blade, as a share of the picture's width.");
  }
  void describe_exposure(service::Fields& fields) {
    auto& exposure = scenario.exposure;
    fields.number("time_s", exposure.time_s, {0, 0.1}, "s", "Motion blur is speed x time.");
    fields.number("adapt_s", exposure.adapt_s, {0, 1}, "s", "Time constant of the automatic brightness.");
    fields.number("step", exposure.step, {0, 1}, "", "Brightness changes in steps of this share; 0: smoothly.");
    fields.number("most_gain", exposure.most_gain, {1, 50}, "", "Amplification in the dark; noise grows with it.");
    fields.number("wander", exposure.wander, {0, 0.5}, "", "Slow change of brightness, 1 sigma.");
    fields.number("read_noise_grey", render.read_noise_grey, {0, 50}, "grey levels", "Noise in the dark, 1 sigma.");
    fields.number("shot_noise_grey", render.shot_noise_grey, {0, 5}, "grey levels",
                  "Variance of the light's own noise per grey level.");
  }
  void describe_lens(service::Fields& fields) {
    auto& camera = render.camera;
    fields.number("k1", camera.k1, {-1, 1}, "", "Radial.");
    fields.number("k2", camera.k2, {-1, 1}, "", "Radial, fourth power.");
    fields.number("p1", camera.p1, {-0.1, 0.1}, "", "Tangential.");
    fields.number("p2", camera.p2, {-0.1, 0.1}, "", "Tangential.");
    fields.number("vignetting", render.vignetting, {0, 0.9}, "", "Loss of light in the corners.");
  }
  void describe_vibration(service::Fields& fields) {
    fields.number("shake", shake.scale, {0, 20}, "",
                  "Slow shake; 1 is roll 0.09, pitch 0.14, yaw 0.09 deg and 10 mm at 72 km/h, 1 sigma.");
    fields.number("rattle_rad", shake.rattle_rad, {0, 0.02}, "rad", "Fast pitching at 72 km/h, 1 sigma.");
    fields.number("rattle_hz", shake.rattle_hz, {3, 60}, "Hz", "How fast.");
    fields.number("knock_at_s", shake.knock_at_s, {0, 1e6}, "s",
                  "The camera is knocked in its mount then and stays so; 0: never.");
    fields.number("knock_pitch_rad", shake.knock_pitch_rad, {-0.2, 0.2}, "rad", "By how much, down.");
    fields.number("knock_yaw_rad", shake.knock_yaw_rad, {-0.2, 0.2}, "rad", "By how much, to the left.");
  }
  void describe_frames(service::Fields& fields) {
    auto& frames = scenario.frames;
    fields.number("drop_share", frames.drop_share, {0, 0.9}, "", "Share of pictures that get lost.");
    fields.integer("drop_run", frames.drop_run, {1, 1000}, "pictures", "Lost one after the other.");
    fields.text("drop_when", frames.drop_when, kWhen);
    fields.number("jitter_s", frames.jitter_s, {0, 0.05}, "s", "Error of the stamps, 1 sigma.");
  }
};

}  // namespace railfix::simulator
