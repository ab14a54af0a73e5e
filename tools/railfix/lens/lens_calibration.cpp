#include "lens/lens_calibration.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>

#include "core/units.hpp"

namespace railfix::tool {
namespace {

constexpr size_t kFewestViews = 8;
constexpr int kFieldColumns = 8;
constexpr int kFieldRows = 6;
constexpr double kLeastCoverage = 0.5;
constexpr double kLeastTiltRad = 0.35;
constexpr double kAlikeShare = 0.02;  // of the picture's width, that the corners have moved
constexpr double kOutlier = 3;        // times the median
constexpr double kLeastOutlierPx = 0.3;
constexpr double kWorstFocalShare = 0.005;
constexpr double kWorstRmsPx = 1.5;

template <class... Values>
core::Error sentence(const char* format, Values... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return core::Error{text};
}

/// Mean distance of the corners that both show.
double moved_px(const BoardView& a, const BoardView& b) {
  double sum = 0;
  int common = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const auto same = std::find(b.board_m.begin(), b.board_m.end(), a.board_m[i]);
    if (same == b.board_m.end()) continue;
    sum += cv::norm(a.pixels[i] - b.pixels[static_cast<size_t>(same - b.board_m.begin())]);
    ++common;
  }
  return common == 0 ? INFINITY : sum / common;
}

struct Fit {
  cv::Mat camera;
  cv::Mat distortion;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::Mat sigma;
  double rms_px = 0;
};

Fit fit(const std::vector<BoardView>& views, const cv::Size& size) {
  std::vector<std::vector<cv::Point2f>> pixels;
  std::vector<std::vector<cv::Point3f>> board;
  for (const auto& view : views) {
    pixels.push_back(view.pixels);
    board.push_back(view.board_m);
  }
  Fit result;
  cv::Mat poses_sigma;
  cv::Mat view_errors;
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-10);
  result.rms_px =
      cv::calibrateCamera(board, pixels, size, result.camera, result.distortion, result.rotations, result.translations,
                          result.sigma, poses_sigma, view_errors, cv::CALIB_FIX_K3, until);
  return result;
}

geometry::Intrinsics lens_of(const Fit& fit, const cv::Size& size) {
  const auto& k = fit.camera;
  const auto* d = fit.distortion.ptr<double>();
  return {k.at<double>(0, 0), k.at<double>(1, 1), k.at<double>(0, 2), k.at<double>(1, 2), d[0], d[1], d[2], d[3],
          size.width,         size.height};
}

geometry::Intrinsics sigma_of(const Fit& fit) {
  const auto* s = fit.sigma.ptr<double>();
  return {s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], 0, 0};
}

std::vector<LensCalibration::View> used(const std::vector<BoardView>& views, const Fit& fit) {
  std::vector<LensCalibration::View> all;
  for (size_t i = 0; i < views.size(); ++i) {
    LensCalibration::View view{views[i], {}, 0};
    cv::projectPoints(views[i].board_m, fit.rotations[i], fit.translations[i], fit.camera, fit.distortion,
                      view.reprojected);
    double square = 0;
    for (size_t k = 0; k < view.reprojected.size(); ++k) {
      const cv::Point2f off = view.reprojected[k] - views[i].pixels[k];
      square += off.dot(off);
    }
    view.rms_px = std::sqrt(square / static_cast<double>(view.reprojected.size()));
    all.push_back(std::move(view));
  }
  return all;
}

double largest_tilt(const Fit& fit) {
  std::vector<cv::Vec3d> normals;
  for (const auto& rotation : fit.rotations) {
    cv::Mat matrix;
    cv::Rodrigues(rotation, matrix);
    normals.emplace_back(matrix.at<double>(0, 2), matrix.at<double>(1, 2), matrix.at<double>(2, 2));
  }
  double largest = 0;
  for (const auto& a : normals) {
    for (const auto& b : normals) largest = std::max(largest, std::acos(std::clamp(a.dot(b), -1.0, 1.0)));
  }
  return largest;
}

core::Status good_enough(const LensCalibration& found) {
  if (found.rms_px > kWorstRmsPx) {
    return sentence(
        "the corners miss their places by %.1f px: hold board and camera still, see that the board is flat, "
        "and check --board",
        found.rms_px);
  }
  if (found.coverage < kLeastCoverage) {
    return sentence(
        "the board was only in %.0f %% of the picture's fields, %.0f %% are wanted: hold it into the corners "
        "and the edges too",
        100 * found.coverage, 100 * kLeastCoverage);
  }
  if (found.tilt_rad < kLeastTiltRad || found.sigma.fu_px > kWorstFocalShare * found.lens.fu_px) {
    return sentence(
        "the boards are tilted by at most %.0f degrees, and the focal length is only known to %.1f px: tilt it "
        "by 30 degrees to the left, right, up and down",
        core::deg_from_rad(found.tilt_rad), found.sigma.fu_px);
  }
  return {};
}

}  // namespace

double coverage(const std::vector<BoardView>& views, const cv::Size& size) {
  std::bitset<kFieldColumns * kFieldRows> fields;
  for (const auto& view : views) {
    for (const auto& pixel : view.pixels) {
      const int x =
          std::clamp(static_cast<int>(pixel.x * kFieldColumns / static_cast<float>(size.width)), 0, kFieldColumns - 1);
      const int y =
          std::clamp(static_cast<int>(pixel.y * kFieldRows / static_cast<float>(size.height)), 0, kFieldRows - 1);
      fields.set(static_cast<size_t>(y * kFieldColumns + x));
    }
  }
  return static_cast<double>(fields.count()) / static_cast<double>(fields.size());
}

core::Result<LensCalibration> calibrate_lens(const std::vector<BoardView>& all, const cv::Size& size) {
  LensCalibration result;
  std::vector<BoardView> views;
  for (const auto& view : all) {
    const bool alike = std::any_of(views.begin(), views.end(), [&](const BoardView& one) {
      return moved_px(view, one) < kAlikeShare * size.width;
    });
    if (alike) {
      result.alike.push_back(view.name);
    } else {
      views.push_back(view);
    }
  }
  if (views.size() < kFewestViews) {
    return sentence(
        "the board is seen in %zu pictures, %zu of them different; at least %zu different ones are needed: move "
        "the board through the whole picture, near and far, tilted to all sides (and check --board, which "
        "counts squares)",
        all.size(), views.size(), kFewestViews);
  }
  Fit found = fit(views, size);
  auto looked = used(views, found);
  std::vector<double> errors;
  for (const auto& view : looked) errors.push_back(view.rms_px);
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  const double limit = std::max(kLeastOutlierPx, kOutlier * errors[errors.size() / 2]);
  std::vector<BoardView> kept;
  for (const auto& view : looked) {
    if (view.rms_px > limit) {
      result.outliers.push_back(view.board.name);
    } else {
      kept.push_back(view.board);
    }
  }
  if (kept.size() >= kFewestViews && kept.size() < views.size()) {
    found = fit(kept, size);
    looked = used(kept, found);
    views = std::move(kept);
  } else {
    result.outliers.clear();
  }
  result.views = std::move(looked);
  result.lens = lens_of(found, size);
  result.sigma = sigma_of(found);
  result.rms_px = found.rms_px;
  result.coverage = coverage(views, size);
  result.tilt_rad = largest_tilt(found);
  const auto status = good_enough(result);
  if (!status.ok()) return status.error();
  return result;
}

}  // namespace railfix::tool
