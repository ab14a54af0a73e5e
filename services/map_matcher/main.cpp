#include "map_matcher/map_matcher_service.hpp"

int main(int argc, char** argv) {
  return railfix::service::run<railfix::map_matcher::MapMatcherService>("map_matcher", argc, argv);
}
