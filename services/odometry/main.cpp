#include "odometry/odometry_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::odometry::OdometryService>("odometry", argc, argv);
}
