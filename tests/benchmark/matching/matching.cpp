// railfix-measure-matching: how good the map matcher is, on rides simulated at the level of measurements (no pictures).
#include <cstring>
#include <iostream>

#include "core/result.hpp"
#include "matching.hpp"

namespace {

constexpr const char* kUsage =
    "railfix-measure-matching switches [--count N] [--seed N] [--each]\n"
    "  switches   track choice over simulated passages of switches\n"
    "railfix-measure-matching curvature [--map FILE] [--count N] [--seed N]\n"
    "  curvature  wheel and gyro alone against a map, by default ../shared/data/alignment/sbb_mszw_a2.landxml\n"
    "railfix-measure-matching landmarks [--count N] [--seed N] [--masts-mapped SHARE]\n"
    "  landmarks  which mapped landmark was sighted, with missed and false sightings and a map that is partly wrong;\n"
    "             --masts-mapped: the map has only so many of the masts\n"
    "railfix-measure-matching locate [--map FILE | --track-km KM] [--trips N] [--from N] [--seed N] [--map-error-m M]\n"
    "                         [--elsewhere SEED] [--each]\n"
    "  locate     the place without a prior, over trips of 5 km on a map or a made-up network; the real track wanders\n"
    "             about the mapped one by 0.5 m (1 sigma). --each prints every trip as it ends, --from goes on with\n"
    "             those of the same seed; --elsewhere: the trains run on another made-up network, so no place is "
    "right\n";

}  // namespace

int main(int argc, char** argv) {
  railfix::measure::MatchingOptions options;
  std::string what;
  for (int i = 1; i < argc; ++i) {
    const bool more = i + 1 < argc;
    if ((std::strcmp(argv[i], "--count") == 0 || std::strcmp(argv[i], "--trips") == 0) && more) {
      options.count = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--from") == 0 && more) {
      options.from = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--seed") == 0 && more) {
      options.seed = std::strtoull(argv[++i], nullptr, 10);
    } else if (std::strcmp(argv[i], "--map") == 0 && more) {
      options.map = argv[++i];
    } else if (std::strcmp(argv[i], "--track-km") == 0 && more) {
      options.track_km = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--map-error-m") == 0 && more) {
      options.map_error_m = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--masts-mapped") == 0 && more) {
      options.masts_mapped = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--elsewhere") == 0 && more) {
      options.elsewhere = std::strtoull(argv[++i], nullptr, 10);
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
    if (what == "curvature") return railfix::measure::measure_curvature(options);
    if (what == "landmarks") return railfix::measure::measure_landmarks(options);
    if (what == "locate") return railfix::measure::measure_locate(options);
  } catch (const railfix::core::BadInput& error) {
    std::cerr << "railfix-measure-matching: " << error.what() << "\n";
    return 2;
  }
  std::cerr << kUsage;
  return 2;
}
