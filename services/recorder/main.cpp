#include "recorder/recorder_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::recorder::RecorderService>("recorder", argc, argv);
}
