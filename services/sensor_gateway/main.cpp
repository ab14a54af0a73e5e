#include "sensor_gateway/sensor_gateway_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::sensor_gateway::SensorGatewayService>("sensor_gateway", argc, argv);
}
