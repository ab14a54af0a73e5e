#include "frame_grabber/frame_grabber_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::frame_grabber::FrameGrabberService>("frame_grabber", argc, argv);
}
