#include "track_detector/track_detector_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::track_detector::TrackDetectorService>("track_detector", argc, argv);
}
