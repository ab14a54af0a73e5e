#include "monitor/cab_view.hpp"

#include <cmath>

#include "messaging/message_words.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

constexpr double kNearestM = 4;
constexpr double kFarthestM = 200;
constexpr double kBridgeHeightM = 5.5;
constexpr double kPortalHeightM = 3;

json points_of(const auto& u_px, const auto& v_px, uint32_t count, double scale) {
  json points = json::array();
  for (uint32_t i = 0; i < count && i < u_px.size(); ++i) {
    points.push_back({std::round(10 * scale * u_px[i]) / 10, std::round(10 * scale * v_px[i]) / 10});
  }
  return points;
}

std::string why_not(const msg::TrackView* track) {
  if (track == nullptr) return "no answer of the track detector for this picture";
  if (track->seen_left() == 0 && track->seen_right() == 0) return "not seen";
  if (track->seen_left() == 0) return "left rail not seen";
  if (track->seen_right() == 0) return "right rail not seen";
  return "";
}

double height_of(track::LandmarkKind kind) {
  if (kind == track::LandmarkKind::bridge) return kBridgeHeightM;
  const bool portal = kind == track::LandmarkKind::portal_in || kind == track::LandmarkKind::portal_out;
  return portal ? kPortalHeightM : 0;
}

json landmarks_of(const CabView& view, double scale) {
  json landmarks = json::array();
  if (view.track == nullptr || view.intrinsics == nullptr || view.map == nullptr || !view.train) return landmarks;
  const auto& t = *view.track;
  const geometry::View camera(*view.intrinsics,
                              {t.roll_rad(), t.pitch_rad(), t.yaw_rad(), t.lateral_m(), t.height_m()});
  for (const auto& landmark : view.map->landmarks_ahead(*view.train, kFarthestM)) {
    if (landmark.ahead_m < kNearestM) continue;
    const double x = landmark.ahead_m;
    const double y = view.map->bend_m(*view.train, x) + landmark.across_m;
    const double z = t.vertical_curvature_per_m() * x * x / 2 + height_of(landmark.kind);
    const auto pixel = camera.project({x, y, z});
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() >= view.intrinsics->width_px ||
        pixel->y() >= view.intrinsics->height_px) {
      continue;
    }
    landmarks.push_back({{"kind", track::to_string(landmark.kind)},
                         {"name", landmark.name},
                         {"ahead_m", std::round(10 * x) / 10},
                         {"across_m", std::round(100 * landmark.across_m) / 100},
                         {"x", std::round(10 * scale * pixel->x()) / 10},
                         {"y", std::round(10 * scale * pixel->y()) / 10},
                         {"side", landmark.across_m > 0.5    ? "left"
                                  : landmark.across_m < -0.5 ? "right"
                                                             : "middle"}});
  }
  return landmarks;
}

}  // namespace

json view_message(const CabView& view) {
  const double scale = view.intrinsics != nullptr && view.intrinsics->width_px > 0
                           ? static_cast<double>(view.width_px) / view.intrinsics->width_px
                           : 1;
  const std::string why = why_not(view.track);
  json message{{"kind", "view"},
               {"camera", view.camera},
               {"stamp_ns", view.stamp_ns},
               {"width", view.width_px},
               {"height", view.height_px},
               {"rails", nullptr},
               {"seen", why.empty()},
               {"why", why.empty() ? json(nullptr) : json(why)},
               {"landmarks", landmarks_of(view, scale)},
               {"health", messaging::names_of_picture_health(view.health)}};
  if (view.track != nullptr && (view.track->seen_left() != 0 || view.track->seen_right() != 0)) {
    const auto& t = *view.track;
    message["rails"] = {{"left", points_of(t.left_u_px(), t.left_v_px(), t.left_points(), scale)},
                        {"right", points_of(t.right_u_px(), t.right_v_px(), t.right_points(), scale)}};
  }
  return message;
}

}  // namespace railfix::monitor
