// Draws what the track detector sees on a colour picture, for people.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "track_detector/track_detector.hpp"

namespace railfix::track_detector {

/// Rails (solid where seen), their edge points, the horizon, pose and curvature as text, "not seen" where it is not.
/// `picture` is CV_8UC3 of the camera's size.
void draw_track(cv::Mat& picture, const geometry::Intrinsics& camera, const TrackObservation& observation,
                double gauge_m);

/// What there is to say about a picture without an answer.
void draw_words(cv::Mat& picture, const std::vector<std::string>& warnings);

}  // namespace railfix::track_detector
