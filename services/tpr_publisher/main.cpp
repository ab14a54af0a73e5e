#include "tpr_publisher/tpr_publisher_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::tpr_publisher::TprPublisherService>("tpr_publisher", argc, argv);
}
