#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "simulator/line_builder.hpp"
#include "simulator/scenery.hpp"

namespace railfix::simulator {
namespace {

constexpr double kTunnelWallM = 3.4;  // upright walls, then the vault
constexpr double kTunnelCrownM = 6.1;
constexpr double kLampSpacingM = 25.0;
constexpr double kPlatformHeightM = 0.55;
constexpr double kPlatformWidthM = 4.5;
constexpr double kBridgeDepthM = 9.0;
constexpr double kBridgeUnderM = 6.2;
constexpr double kBridgeOverM = 7.6;
constexpr int kVaultPieces = 6;

// Points of a tunnel's profile from the left wall's foot over the crown to the right wall's foot.
struct ProfilePoint {
  double lateral_m, up_m;
};
ProfilePoint vault(const Span& tunnel, int i) {
  const double angle = core::kPi * i / kVaultPieces;
  const double middle = 0.5 * (tunnel.left_m + tunnel.right_m);
  const double half = 0.5 * (tunnel.left_m - tunnel.right_m);
  return {middle + half * std::cos(angle), kTunnelWallM + (kTunnelCrownM - kTunnelWallM) * std::sin(angle)};
}

// The wall around the opening, and the hill over it. It ends exactly where the inside begins, whose panels are drawn
// before it.
void add_portal(Stage& stage, const Span& tunnel) {
  const double s = tunnel.begin_m;
  const double left = tunnel.left_m + 4.0;
  const double right = tunnel.right_m - 4.0;
  const double top = kTunnelCrownM + 1.8;
  // Hill: slopes at the sides, flat above.
  const double back = s + 0.02;
  for (const auto& [inner, outer] : {std::pair{left, left + 30.0}, std::pair{right, right - 30.0}}) {
    stage.panel({stage.at(back, inner, -1.5), stage.at(back, outer, -1.5), stage.at(back, outer, 1.0),
                 stage.at(back, inner, 13.0)},
                0.30F, back);
  }
  stage.panel({stage.at(back, right, top - 0.5), stage.at(back, left, top - 0.5), stage.at(back, left, 13.0),
               stage.at(back, right, 13.0)},
              0.33F, back);
  const double front = s - 0.005;
  for (const auto& [inner, outer] : {std::pair{tunnel.left_m, left}, std::pair{tunnel.right_m, right}}) {
    stage.face({stage.at(s, inner, -0.8), stage.at(s, outer, -0.8), stage.at(s, outer, top), stage.at(s, inner, top)},
               0.55F, front);
  }
  for (int i = 0; i < kVaultPieces; ++i) {
    const auto a = vault(tunnel, i);
    const auto b = vault(tunnel, i + 1);
    stage.panel({stage.at(s, a.lateral_m, a.up_m), stage.at(s, b.lateral_m, b.up_m), stage.at(s, b.lateral_m, top),
                 stage.at(s, a.lateral_m, top)},
                0.55F, front);
  }
  stage.panel(
      {stage.at(s, left, top), stage.at(s, right, top), stage.at(s, right, top + 0.35), stage.at(s, left, top + 0.35)},
      0.62F, s - 0.01);
}

void add_lamps(Stage& stage, const Span& tunnel) {
  const double last = std::min(tunnel.end_m, stage.foot_m() + Stage::kFarM);
  const double first = std::ceil(std::max(0.0, stage.foot_m() - tunnel.begin_m) / kLampSpacingM - 0.5) + 0.5;
  for (double s = tunnel.begin_m + first * kLampSpacingM; s < last; s += kLampSpacingM) {
    const double d = tunnel.left_m - 0.06;
    stage.glow(
        {stage.at(s - 0.6, d, 3.0), stage.at(s + 0.6, d, 3.0), stage.at(s + 0.6, d, 3.2), stage.at(s - 0.6, d, 3.2)},
        0.9F, s - 3.0);
  }
}

void add_tunnel_inside(Stage& stage, const Span& tunnel) {
  stage.along(tunnel.begin_m, tunnel.end_m, 2.5, [&](double a, double b) {
    const double middle = 0.5 * (a + b);
    const float shade = 0.85F + 0.3F * unit_float(mix_bits(91, std::llround((a - tunnel.begin_m) / 2.5)));
    const double to_lamp = std::remainder(middle - tunnel.begin_m - 0.5 * kLampSpacingM, kLampSpacingM);
    const auto lamp = static_cast<float>(0.10 * std::exp(-to_lamp * to_lamp / 8.0));
    const auto side = [&](double d, float glow) {
      const Quad wall{stage.at(a, d, -0.8), stage.at(b, d, -0.8), stage.at(b, d, kTunnelWallM),
                      stage.at(a, d, kTunnelWallM)};
      if (b > tunnel.end_m - 0.01) {
        stage.face(wall, 0.42F * shade, a, glow);  // the way out is where it ends
      } else {
        stage.panel(wall, 0.42F * shade, a, glow);
      }
    };
    side(tunnel.left_m, lamp);
    side(tunnel.right_m, 0.3F * lamp);
    for (int i = 0; i < kVaultPieces; ++i) {
      const auto p = vault(tunnel, i);
      const auto q = vault(tunnel, i + 1);
      const float grey = 0.30F + 0.02F * static_cast<float>(i % 2);
      stage.panel({stage.at(a, p.lateral_m, p.up_m), stage.at(b, p.lateral_m, p.up_m), stage.at(b, q.lateral_m, q.up_m),
                   stage.at(a, q.lateral_m, q.up_m)},
                  grey * shade, a, 0.5F * lamp);
    }
  });
}

void add_tunnels(Stage& stage) {
  for (const auto& tunnel : stage.line().tunnels()) {
    if (tunnel.begin_m - stage.foot_m() > Stage::kFarM || tunnel.end_m < stage.foot_m()) continue;
    if (stage.seen(tunnel.begin_m)) add_portal(stage, tunnel);
    add_tunnel_inside(stage, tunnel);
    add_lamps(stage, tunnel);
    // Behind the far end of the sight nothing of the outside shows.
    const double last = stage.foot_m() + Stage::kFarM;
    if (tunnel.end_m > last)
      stage.face({stage.at(last, tunnel.right_m, -2.0), stage.at(last, tunnel.left_m, -2.0),
                  stage.at(last, tunnel.left_m, 7.0), stage.at(last, tunnel.right_m, 7.0)},
                 0.01F, last);
  }
}

void add_platform(Stage& stage, const Span& platform) {
  const double out = platform.outward;
  const double edge = platform.lateral_m;
  stage.along(platform.begin_m, platform.end_m, 3.0, [&](double a, double b) {
    const auto strip = [&](double from, double to, float grey) {
      stage.panel({stage.at(a, edge + out * from, kPlatformHeightM), stage.at(b, edge + out * from, kPlatformHeightM),
                   stage.at(b, edge + out * to, kPlatformHeightM), stage.at(a, edge + out * to, kPlatformHeightM)},
                  grey, a);
    };
    const float shade = 0.03F * unit_float(mix_bits(77, std::llround((a - platform.begin_m) / 3.0)));
    strip(0.9, kPlatformWidthM, 0.47F + shade);
    strip(0.75, 0.9, 0.86F);
    strip(0.12, 0.75, 0.54F + shade);
    strip(0.0, 0.12, 0.66F + shade);
    stage.panel({stage.ground(a, edge), stage.ground(b, edge), stage.at(b, edge, kPlatformHeightM),
                 stage.at(a, edge, kPlatformHeightM)},
                0.24F + shade, a);
    stage.cast(a, edge, b, edge, 0.0, kPlatformHeightM);
  });
  if (stage.seen(platform.begin_m)) {
    const double s = platform.begin_m;
    stage.face({stage.ground(s, edge), stage.ground(s, edge + out * kPlatformWidthM),
                stage.at(s, edge + out * kPlatformWidthM, kPlatformHeightM), stage.at(s, edge, kPlatformHeightM)},
               0.40F, s - 0.01);
  }
  for (double s = platform.begin_m + 12.0; s < platform.end_m; s += 28.0) {
    if (!stage.seen(s)) continue;
    stage.bar(stage.at(s, edge + out * 3.2, kPlatformHeightM), stage.at(s, edge + out * 3.2, 4.6), 0.12, 0.28F, s);
    stage.bar(stage.at(s, edge + out * 3.4, 4.6), stage.at(s, edge + out * 2.2, 4.7), 0.14, 0.6F, s);
    stage.board(s, edge + out * 3.9, 0.9, kPlatformHeightM, 1.9, 0.30F);
  }
}

void add_platforms(Stage& stage) {
  for (const auto& platform : stage.line().platforms()) {
    if (platform.begin_m - stage.foot_m() < Stage::kFarM && platform.end_m > stage.foot_m())
      add_platform(stage, platform);
  }
}

// Deck with its dark underside, abutments and the road's embankment at both sides.
void add_bridge(Stage& stage, const Bridge& bridge) {
  const double s = bridge.distance_m;
  const double end = s + kBridgeDepthM;
  const double left = bridge.left_m;
  const double right = bridge.right_m;
  if (stage.seen(s)) {
    stage.panel({stage.at(s, left + 2.0, kBridgeUnderM), stage.at(s, right - 2.0, kBridgeUnderM),
                 stage.at(s, right - 2.0, kBridgeOverM), stage.at(s, left + 2.0, kBridgeOverM)},
                0.45F, s);
    stage.panel({stage.at(s, left + 2.0, kBridgeOverM), stage.at(s, right - 2.0, kBridgeOverM),
                 stage.at(s, right - 2.0, kBridgeOverM + 0.3), stage.at(s, left + 2.0, kBridgeOverM + 0.3)},
                0.56F, s - 0.01);
  }
  stage.panel({stage.at(s, left, kBridgeUnderM), stage.at(s, right, kBridgeUnderM), stage.at(end, right, kBridgeUnderM),
               stage.at(end, left, kBridgeUnderM)},
              0.10F, s + 0.1);
  for (const auto& [wall, outward] : {std::pair{left, 1.0}, std::pair{right, -1.0}}) {
    stage.panel({stage.ground(s, wall), stage.ground(end, wall), stage.at(end, wall, kBridgeUnderM),
                 stage.at(s, wall, kBridgeUnderM)},
                0.24F, s + 0.05);
    if (!stage.seen(s)) continue;
    stage.face({stage.ground(s, wall), stage.ground(s, wall + outward * 2.0),
                stage.at(s, wall + outward * 2.0, kBridgeOverM), stage.at(s, wall, kBridgeOverM)},
               0.50F, s);
    stage.panel({stage.ground(s, wall + outward * 2.0), stage.ground(s, wall + outward * 26.0),
                 stage.ground(s, wall + outward * 26.0), stage.at(s, wall + outward * 2.0, kBridgeOverM)},
                0.31F, s);
  }
  stage.shade({stage.stones(s, left), stage.stones(s, right), stage.stones(end, right), stage.stones(end, left)}, 0.6);
  stage.cast(s, left, s, right, kBridgeUnderM, kBridgeOverM);
  stage.cast(end, left, end, right, kBridgeUnderM, kBridgeOverM);
}

void add_bridges(Stage& stage) {
  for (const auto& bridge : stage.line().bridges()) {
    if (bridge.distance_m - stage.foot_m() < Stage::kFarM && bridge.distance_m + kBridgeDepthM > stage.foot_m())
      add_bridge(stage, bridge);
  }
}

}  // namespace

void add_buildings(Stage& stage) {
  add_platforms(stage);
  add_bridges(stage);
  add_tunnels(stage);
}

}  // namespace railfix::simulator
