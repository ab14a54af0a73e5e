#include "fusion/fusion_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::fusion::FusionService>("fusion", argc, argv);
}
