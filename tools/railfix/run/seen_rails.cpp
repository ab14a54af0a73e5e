#include "run/seen_rails.hpp"

#include <array>
#include <limits>

namespace railfix::tool {
namespace {

void unpack(const std::array<double, 28>& upper, Eigen::Matrix<double, 7, 7>& covariance) {
  size_t k = 0;
  for (int r = 0; r < 7; ++r) {
    for (int c = r; c < 7; ++c) covariance(r, c) = covariance(c, r) = upper[k++];
  }
}

// track_view leaves out how far the rails were followed and the change of curvature; the edge points still show both.
void complete_from_points(const geometry::Intrinsics& camera, track_detector::TrackObservation& observation) {
  const geometry::View view(camera, observation.shape.camera);
  auto& shape = observation.shape;
  double near_m = std::numeric_limits<double>::infinity();
  double far_m = 0;
  double left_over = 0;
  double weight = 0;
  for (const auto& point : observation.points) {
    auto place = view.on_plane(point.pixel, 0);
    if (place) place = view.on_plane(point.pixel, shape.vertical_curvature_per_m * place->x() * place->x() / 2);
    if (!place) continue;
    const double x = place->x();
    near_m = std::min(near_m, x);
    far_m = std::max(far_m, x);
    const double residual_m = place->y() - rail_point(shape, point.side, kGaugeM, x).y();
    left_over += residual_m * x;  // times x^3 / 6, by the 1 / x^2 that makes metres pixels
    weight += x * x * x * x / 6;
  }
  observation.near_m = near_m;
  observation.far_m = far_m;
  if (weight > 0) shape.curvature_rate_per_m2 = left_over / weight;
}

}  // namespace

track_detector::TrackObservation observation_of(const msg::TrackView& view, const geometry::Intrinsics& camera) {
  track_detector::TrackObservation observation;
  observation.seen_left = view.seen_left() != 0;
  observation.seen_right = view.seen_right() != 0;
  observation.shape.camera = {view.roll_rad(), view.pitch_rad(), view.yaw_rad(), view.lateral_m(), view.height_m()};
  observation.shape.curvature_per_m = view.curvature_per_m();
  observation.shape.vertical_curvature_per_m = view.vertical_curvature_per_m();
  observation.residual_px = view.residual_px();
  observation.confidence = view.confidence();
  const auto add = [&](const auto& u_px, const auto& v_px, uint32_t count, track_detector::Side side) {
    for (uint32_t i = 0; i < count && i < u_px.size(); ++i) {
      track_detector::EdgePoint point;
      point.pixel = {u_px[i], v_px[i]};
      point.side = side;
      observation.points.push_back(point);
    }
  };
  add(view.left_u_px(), view.left_v_px(), view.left_points(), track_detector::Side::left);
  add(view.right_u_px(), view.right_v_px(), view.right_points(), track_detector::Side::right);
  unpack(view.covariance(), observation.covariance);
  complete_from_points(camera, observation);
  return observation;
}

}  // namespace railfix::tool
