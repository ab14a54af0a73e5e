// railfix map locate: where on a map a run took place, from how it turned alone.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "commands.hpp"
#include "core/csv_table.hpp"
#include "core/result.hpp"
#include "map_matcher/locate/network_locator.hpp"
#include "map_matcher/step_chain.hpp"
#include "number_between.hpp"
#include "recording/utc_text.hpp"

namespace railfix::tool {
namespace {

constexpr double kLongestGapS = 1.0;

struct LocateRequest {
  std::string map;
  std::string run;
  double until_m = 1e9;
};

/// Where odometry.csv of a run could not be used.
struct Breaks {
  size_t measured = 0;  // rows that could
  int count = 0;
  int64_t last_ns = 0;
  void add(int64_t stamp_ns) {
    ++count;
    last_ns = stamp_ns;
  }
};

/// Feeds odometry.csv of a run; what lies before a gap or a blind spell is forgotten.
core::Result<Breaks> feed(const std::filesystem::path& file, double until_m, map_matcher::NetworkLocator& locator) {
  core::CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t valid = table.required({"valid"});
  const size_t distance = table.required({"distance_m"});
  const size_t rate = table.required({"yaw_rate_rps"});
  bool started = false;
  double last_m = 0;
  int64_t last_ns = 0;
  Breaks breaks;
  while (table.next(stamp)) {
    const double at_m = table.number_or_nan(distance);
    const double rate_rps = table.number_or_nan(rate);
    const double dt_s = 1e-9 * static_cast<double>(table.stamp_ns() - last_ns);
    if (started && std::abs(at_m) > until_m) break;
    const bool measured = table.integer(valid) != 0 && std::isfinite(at_m) && std::isfinite(rate_rps);
    if (started && (!measured || dt_s >= kLongestGapS)) {
      breaks.add(table.stamp_ns());
      locator.forget();
      started = false;
    }
    if (!measured) continue;
    ++breaks.measured;
    if (started && at_m != last_m) locator.move(at_m - last_m, rate_rps * dt_s, map_matcher::kYawNoiseRad);
    started = true;
    last_m = at_m;
    last_ns = table.stamp_ns();
  }
  if (const auto read = table.status(); !read.ok()) return read.error();
  if (breaks.measured == 0) {
    return core::Error{file.string() +
                       " has no row in which the camera measured how the train ran and turned; a run without camera "
                       "cannot be located by it"};
  }
  return breaks;
}

int locate(const LocateRequest& request) {
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(request.map)));
  map_matcher::NetworkLocator locator({}, std::make_shared<const map_matcher::NetworkIndex>(map));
  const auto breaks =
      core::value_or_throw(feed(std::filesystem::path(request.run) / "odometry.csv", request.until_m, locator));
  const auto location = locator.locate();
  std::printf("way              %.0f m, compared with %zu places\n", locator.way_m(), location.candidates);
  if (breaks.count > 0) {
    std::printf("                 since %s, when odometry broke off last (%d in all): what lies before is of no use\n",
                utc_text(breaks.last_ns).c_str(), breaks.count);
  }
  if (location.places.empty()) {
    std::printf("place            not yet known: the way is too short or bends too little\n");
    return 0;
  }
  const char* certainty = location.certain() ? "" : location.place_certain() ? "certain, but " : "not yet certain: ";
  std::printf("place            %s%s\n", certainty, to_string(location.doubt).c_str());
  for (size_t i = 0; i < std::min<size_t>(location.places.size(), 8); ++i) {
    const auto& p = location.places[i];
    std::printf("  %6.2f %%  %s:%.0f:%c  %s, +-%.0f m, scale %.4f, misfit %.2f\n", 100 * p.probability,
                map->edge_text(p.place.edge).c_str(), p.place.offset_m,
                p.place.direction == track::Direction::reverse ? '-' : '+', map->edge(p.place.edge)->name.c_str(),
                p.sigma_m, p.scale, p.misfit);
  }
  return 0;
}

}  // namespace

void add_map_locate(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<LocateRequest>();
  CLI::App* command = map.add_subcommand("locate", "Where on a map a run took place, from how it turned alone");
  command->add_option("MAP", request->map, "A map made by `railfix map build` or `railfix map make`")->required();
  command->add_option("--run", request->run, "Folder of a run, with odometry.csv")->required();
  command->add_option("--until", request->until_m, "Use the run up to this distance")->check(number_between(0.0, 1e9));
  command->footer("Example:\n  railfix map locate national.map --run OUT");
  command->callback([request, &chosen] { chosen = [request] { return locate(*request); }; });
}

}  // namespace railfix::tool
