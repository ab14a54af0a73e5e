// railfix-measure-matching: how good the map matcher is, on rides simulated at the level of measurements (no pictures).
#include "matching.hpp"

#include <map>

#include "measuring_tool.hpp"
#include "number_between.hpp"
#include "whole_number.hpp"

namespace {

using namespace railfix;  // NOLINT(google-build-using-namespace)

using Measure = int (*)(const measure::MatchingOptions&);
const std::map<std::string, Measure> kMeasures{{"switches", measure::measure_switches},
                                               {"curvature", measure::measure_curvature},
                                               {"landmarks", measure::measure_landmarks},
                                               {"locate", measure::measure_locate}};

constexpr const char* kWhat =
    "switches: track choice over simulated passages of switches\n"
    "curvature: wheel and gyro alone against a map, by default alignment/sbb_mszw_a2.landxml of\n"
    "  RAILFIX_DATA, else of ../shared/data beside the sources\n"
    "landmarks: which mapped landmark was sighted, with missed and false sightings and a map that is partly wrong\n"
    "locate: the place without a prior, over trips of 5 km on a map or a made-up network; the real track wanders "
    "about\n"
    "  the mapped one by 0.5 m (1 sigma)";

void add_options(CLI::App& app, measure::MatchingOptions& options) {
  constexpr uint64_t kMost = 1'000'000'000;
  app.add_option("--count,--trips", options.count,
                 "Passages, runs, lines or trips; else as many as the figure asks for")
      ->check(tool::whole_number(1, kMost));
  app.add_option("--seed", options.seed, "Other seeds, other rides")->check(tool::whole_number());
  app.add_option("--map", options.map, "curvature, locate: on this map");
  app.add_option("--track-km", options.track_km, "locate: size of the made-up network")
      ->check(tool::number_between(20, 100000));
  app.add_option("--from", options.from, "locate: goes on with the trips of the same seed from this one on")
      ->check(tool::whole_number(0, kMost));
  app.add_option("--map-error-m", options.map_error_m, "locate: so far is a track from the mapped one")
      ->check(tool::number_between(0, 1000));
  app.add_option("--elsewhere", options.elsewhere,
                 "locate: the trains run on another made-up network, of this seed, so no place is right")
      ->check(tool::whole_number(1));
  app.add_option("--masts-mapped", options.masts_mapped, "landmarks: the map has only this share of the masts")
      ->check(tool::number_between(0, 1));
  app.add_flag("--gnss", options.gnss, "locate: where GNSS alone finds the train, too");
  auto* astern = app.add_flag("--astern", options.astern, "locate: the trains back all the way");
  auto* back = app.add_option("--back-m", options.back_m, "locate: after 1.5 km the trains set back so far, and go on")
                   ->check(tool::number_between(0, 1500))
                   ->excludes(astern);
  app.add_flag("--other-leg", options.other_leg, "... over another leg of a switch that they set back over")
      ->needs(back);
  app.add_flag("--just-clear", options.just_clear,
               "switches: all trains set back to a metre before the points, which are thrown then, and go on");
  auto* fault = app.add_option("--gyro-fault", options.gyro_fault,
                               "switches: all trains have a gyro alone, which fails 40 m before the points")
                    ->check(CLI::IsMember({"stuck", "bias", "noise"}));
  app.add_option("--fault-rps", options.fault_rps, "... by this error, either way, or this noise of a sample")
      ->check(tool::number_between(0, 1))
      ->needs(fault);
  app.add_flag("--each", options.each, "A line for each ride that went wrong; locate: for every trip as it ends");
}

}  // namespace

int main(int argc, char** argv) {
  measure::MatchingOptions options;
  std::string what;
  CLI::App app("How good the map matcher is, on rides simulated at the level of measurements",
               "railfix-measure-matching");
  app.footer(kWhat);
  app.add_option("WHAT", what, "switches, curvature, landmarks or locate, as below")
      ->required()
      ->check(CLI::IsMember({"switches", "curvature", "landmarks", "locate"}));
  add_options(app, options);
  return measure::run_tool(app, argc, argv, [&] { return kMeasures.at(what)(options); });
}
