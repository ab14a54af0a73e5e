#include "monitor/monitor_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::monitor::MonitorService>("monitor", argc, argv);
}
