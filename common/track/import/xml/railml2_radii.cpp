#include "track/import/xml/railml2_radii.hpp"

#include <algorithm>
#include <cmath>

#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

struct RadiusChange {
  double offset_m = 0;
  double curvature_per_m = 0;
  std::optional<double> cant_m;
};

/// The superelevations of one track.
class CantReader {
 public:
  CantReader(const XmlSource& source, const NetTrack& track, std::vector<std::string>& problems)
      : source_(source), track_(track), problems_(problems) {}

  /// Nothing where no cant begins.
  std::optional<double> cant_of(const pugi::xml_node& change, double curvature_per_m) {
    const auto cant_mm = source_.number(change, "superelevation");
    if (!cant_mm || *cant_mm == 0) return cant_mm;
    if (!is_cant(1e-3 * *cant_mm)) {
      problems_.push_back(
          railml_has(change, track_, "superelevation", std::string("mm, ") + kNoTrackHas + "; no cant begins there"));
      return std::nullopt;
    }
    if (curvature_per_m == 0) {
      on_straights_.push_back(change);
      return std::nullopt;
    }
    if (*cant_mm < 0) below_0_.push_back(change);
    return std::copysign(1e-3 * *cant_mm, curvature_per_m);
  }

  void tell() {
    tell(below_0_,
         "below 0: the schema does not say what the sign means, so the outer rail is taken as the higher one");
    tell(on_straights_, "on a straight: which rail is higher is not said; no cant begins there");
  }

 private:
  /// One sentence for all of a kind.
  void tell(const std::vector<pugi::xml_node>& changes, const std::string& what) {
    if (changes.empty()) return;
    const std::string more = told_as_more(changes.size());
    problems_.push_back(railml_has(changes.front(), track_, "superelevation", "mm" + more + " " + what));
  }

  const XmlSource& source_;
  const NetTrack& track_;
  std::vector<std::string>& problems_;
  std::vector<pugi::xml_node> below_0_;
  std::vector<pugi::xml_node> on_straights_;
};

/// Like the radius, the cant holds from a change on up to the next one.
std::vector<CantPoint> cant_of(const std::vector<RadiusChange>& changes) {
  if (std::none_of(changes.begin(), changes.end(), [](const RadiusChange& c) { return c.cant_m.has_value(); }))
    return {};
  std::vector<CantPoint> out;
  out.reserve(changes.size());
  for (const RadiusChange& change : changes) out.push_back({change.offset_m, change.cant_m.value_or(0)});
  return held(std::move(out));
}

}  // namespace

void read_radii2(const XmlSource& source, const pugi::xml_node& radius_changes, double origin_m, NetTrack& track,
                 std::vector<std::string>& problems) {
  std::vector<RadiusChange> changes;
  CantReader cant(source, track, problems);
  for (const pugi::xml_node& change : radius_changes.children("radiusChange")) {
    const double offset_m = source.required(change, "pos") - origin_m;
    if (!is_on_track(offset_m, track.length_m)) {
      problems.push_back(not_on_its_track(change));
      continue;
    }
    const double radius = source.required(change, "radius");
    if (radius != 0 && std::abs(radius) < 10) throw source.wrong(change, "a radius of less than 10 m is no railway's");
    const double curvature_per_m = radius == 0 ? 0.0 : -1.0 / radius;
    changes.push_back({offset_m, curvature_per_m, cant.cant_of(change, curvature_per_m)});
  }
  cant.tell();
  std::ranges::stable_sort(changes, {}, &RadiusChange::offset_m);
  for (size_t i = 0; i < changes.size(); ++i) {
    const double from = changes[i].offset_m;
    const double to = i + 1 < changes.size() ? changes[i + 1].offset_m : track.length_m;
    const double curvature = changes[i].curvature_per_m;
    if (curvature != 0 && to > from) track.bends.push_back({from, to, curvature, curvature});
  }
  track.cant = cant_of(changes);
}

}  // namespace railfix::track
