// railfix-measure-matching: how good the map matcher is, on rides simulated at the level of measurements (no pictures).
#include <cstring>
#include <iostream>

#include "core/result.hpp"
#include "matching.hpp"

namespace {

constexpr const char* kUsage =
    "railfix-measure-matching switches [--count N] [--seed N] [--each]\n"
    "  switches   track choice over simulated passages of switches\n";

}  // namespace

int main(int argc, char** argv) {
  railfix::measure::MatchingOptions options;
  std::string what;
  for (int i = 1; i < argc; ++i) {
    const bool more = i + 1 < argc;
    if (std::strcmp(argv[i], "--count") == 0 && more) {
      options.count = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--seed") == 0 && more) {
      options.seed = std::strtoull(argv[++i], nullptr, 10);
    } else if (std::strcmp(argv[i], "--map") == 0 && more) {
      options.map = argv[++i];
    } else if (std::strcmp(argv[i], "--each") == 0) {
      options.each = true;
    } else if (what.empty() && argv[i][0] != '-') {
      what = argv[i];
    } else {
      what.clear();
      break;
    }
  }
  try {
    if (what == "switches") return railfix::measure::measure_switches(options);
  } catch (const railfix::core::BadInput& error) {
    std::cerr << "railfix-measure-matching: " << error.what() << "\n";
    return 2;
  }
  std::cerr << kUsage;
  return 2;
}
