#include "simulator/scenery.hpp"

namespace railfix::simulator {

void draw_scenery(const Line& line, const LocalTrack& main, const Illumination& light, const RenderOptions& options,
                  const Shot& shot, cv::Mat& radiance) {
  if (main.empty()) return;
  Stage stage(line, main, light, options, shot);
  add_furniture(stage);
  add_buildings(stage);
  add_trains(stage, options.trains, shot.look.time_s);
  stage.paint(geometry::View(options.camera, shot.pose), radiance);
}

}  // namespace railfix::simulator
