#include "track/import/xml/landxml.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <optional>
#include <string_view>

#include "core/units.hpp"
#include "track/import/told.hpp"
#include "track/import/xml/landxml_reach.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {
namespace {

constexpr double kToleratedStationM = 0.01;
constexpr double kToleratedLengthM = 1e-3;
constexpr double kToleratedStepRad = 1e-3;
constexpr double kToleratedGapM = 1e-4;
constexpr double kMostTurnRad = core::kPi + 1e-3;  // half a circle, to the rounding of its length
constexpr double kSameHeightM = 1e-3;
constexpr size_t kMostProblems = 200;

/// Reads one document; errors are thrown as BadInput inside and become values at the door.
class LandXmlReader {
 public:
  explicit LandXmlReader(const std::filesystem::path& file) : source_(file) {}

  LandXml read() {
    const pugi::xml_node root = source_.root();
    if (std::string_view(root.name()) != "LandXML") {
      throw core::BadInput(source_.file_name() + " is XML but not LandXML, railML, OpenStreetMap nor an ERJU " +
                           "infrastructure or map: its first element is <" + root.name() +
                           ">; give one that begins with <LandXML>, <railml>, <railML>, <osm> or one of "
                           "https://erju.org/infra or /map");
    }
    check_units(root);
    for (const pugi::xml_node& group : root.children("Alignments")) {
      for (const pugi::xml_node& alignment : group.children("Alignment")) read_alignment(alignment);
    }
    if (out_.tracks.empty()) throw core::BadInput(source_.file_name() + " holds no <Alignment> with <CoordGeom>");
    out_.crs = find_crs(root);
    return std::move(out_);
  }

 private:
  void problem(const std::string& sentence) {
    if (out_.problems.size() < kMostProblems) out_.problems.push_back(sentence);
  }

  /// "northing easting [height]"
  [[nodiscard]] Eigen::Vector2d point(const pugi::xml_node& element, const char* name) const {
    const std::vector<double> numbers = numbers_of(element.child(name).text().get());
    if (numbers.size() < 2) {
      throw source_.wrong(element,
                          "<" + std::string(element.name()) + "> needs <" + name + "> with northing and easting");
    }
    return {numbers[1], numbers[0]};
  }

  void check_units(const pugi::xml_node& root) {
    const pugi::xml_node units = root.child("Units");
    const std::string_view unit = units.child("Metric").attribute("linearUnit").value();
    if (units.child("Imperial") || (!unit.empty() && unit != "meter" && unit != "metre")) {
      throw source_.wrong(units, "only LandXML in metres is read; export it with <Metric linearUnit=\"meter\">");
    }
    if (unit.empty()) problem("the file names no unit of length (<Metric linearUnit=...>): metres are taken");
  }

  /// Left positive; nothing for a radius of INF.
  [[nodiscard]] double curvature(const pugi::xml_node& element, const char* name) const {
    const std::string_view text = element.attribute(name).value();
    if (text == "INF" || text == "inf" || text == "Infinity") return 0.0;
    const double radius = source_.required(element, name);
    const std::string_view rotation = element.attribute("rot").value();
    if (radius < 10.0) throw source_.wrong(element, "a radius of less than 10 m is not a railway's");
    if (rotation != "cw" && rotation != "ccw") throw source_.wrong(element, "rot must be cw or ccw");
    return (rotation == "ccw" ? 1.0 : -1.0) / radius;
  }

  struct Plan {
    std::vector<Element> elements;
    std::vector<PlanPose> starts;
    std::vector<std::pair<double, double>>
        stations;  // the file's station and our offset where elements begin and end, in order
  };

  void add_element(const pugi::xml_node& node, const std::string& track, Plan& plan) {
    const std::string_view kind = node.name();
    double start = 0;
    double end = 0;
    if (kind == "Curve") {
      if (const std::string_view type = node.attribute("crvType").value(); !type.empty() && type != "arc") {
        throw source_.wrong(node, "only curves of crvType arc are read");
      }
      start = end = curvature(node, "radius");
    } else if (kind == "Spiral") {
      start = curvature(node, "radiusStart");
      end = curvature(node, "radiusEnd");
      if (const std::string_view type = node.attribute("spiType").value(); type != "clothoid") {
        problem(track + ": the spiral in line " + source_.line_of(node) + " is a " + std::string(type) +
                ", taken as a clothoid");
      }
    } else if (kind != "Line") {
      throw source_.wrong(node, "<" + std::string(kind) + "> cannot be read; only Line, Curve and Spiral can");
    }
    const Eigen::Vector2d from = point(node, "Start");
    const Eigen::Vector2d to = point(node, "End");
    const std::string where = track + ": the element in line " + source_.line_of(node);
    const double chord = (to - from).norm();
    double length = kind == "Line" ? chord : source_.required(node, "length");
    if (kind == "Curve" && chord > 1e-4 && !(length > 1e-4) && chord * std::abs(start) < 2) {
      problem(where + " has the length " + told_m(length) + "; it gets that of the arc between its points");
      length = 2 * std::asin(0.5 * chord * std::abs(start)) / std::abs(start);
    }
    if (!(chord > 1e-4) || !(length > 1e-4)) {
      problem(where + " has no length and is left out");
      return;
    }
    if (length > 1e6 || !(chord < 1e6) || std::max(std::abs(start), std::abs(end)) * length > kMostTurnRad) {
      throw source_.wrong(node, "the element turns by more than half a circle or is longer than 1000 km");
    }
    const double length_in_file = kind == "Line" ? source_.number(node, "length").value_or(chord) : length;
    if (!(length_in_file > 0))
      throw source_.wrong(node, "the element's points are apart, but its length is not above 0");
    if (const auto station = source_.number(node, "staStart")) begin_at(*station, where, plan);
    take(close_element(from, to, start, end, length), to, length_in_file, where, plan);
  }

  /// Profile and cant are told by the file's stations, and where its lengths do not add up to them, these hold.
  void begin_at(double station, const std::string& where, Plan& plan) {
    auto& [counted, offset_m] = plan.stations.back();
    const double off_m = station - counted;
    if (std::abs(off_m) <= kToleratedStationM) return;
    problem(where + " begins at " + told_m(station) + ", " + told_m(std::abs(off_m)) +
            (off_m > 0 ? " behind" : " before") + " the end of the one before");
    if (off_m > 0) {
      plan.stations.emplace_back(station, offset_m);
    } else if (plan.stations.size() < 2 || plan.stations[plan.stations.size() - 2].first < station) {
      counted = station;
    }
  }

  void take(const ClosedElement& closed, const Eigen::Vector2d& to, double file_length, const std::string& where,
            Plan& plan) {
    const double change = std::abs(closed.element.length_m - file_length);
    if (change > kToleratedLengthM) {
      problem(where + " has points that are " + told_m(change, 6) +
              " nearer or farther than its length and radius say");
    }
    if (!plan.elements.empty()) {
      const PlanPose before = advance(plan.starts.back(), plan.elements.back(), plan.elements.back().length_m);
      const double step = std::abs(core::wrap_pi(closed.start.heading_rad - before.heading_rad));
      const double gap =
          std::hypot(closed.start.easting_m - before.easting_m, closed.start.northing_m - before.northing_m);
      if (step > kToleratedStepRad) problem(where + " begins with a kink of " + std::to_string(step) + " rad");
      if (gap > kToleratedGapM) problem(where + " begins " + told_m(gap, 6) + " from the end of the one before");
      out_.figures.max_gap_m = std::max(out_.figures.max_gap_m, gap);
      out_.figures.max_heading_step_rad = std::max(out_.figures.max_heading_step_rad, step);
    }
    const Element as_told{file_length, closed.element.curvature_start_per_m, closed.element.curvature_end_per_m};
    const PlanPose end = advance(closed.start, as_told, file_length);
    ++out_.figures.elements;
    out_.figures.max_length_change_m = std::max(out_.figures.max_length_change_m, change);
    out_.figures.max_end_error_m =
        std::max(out_.figures.max_end_error_m, std::hypot(end.easting_m - to.x(), end.northing_m - to.y()));
    plan.stations.push_back(
        {plan.stations.back().first + file_length, plan.stations.back().second + closed.element.length_m});
    plan.elements.push_back(closed.element);
    plan.starts.push_back(closed.start);
  }

  /// Our offset for a station of the file.
  [[nodiscard]] static double offset_at(const Plan& plan, double station) {
    const auto after = std::upper_bound(plan.stations.begin() + 1, plan.stations.end() - 1, station,
                                        [](double value, const auto& entry) { return value < entry.first; });
    const auto [station_a, offset_a] = *(after - 1);
    const auto [station_b, offset_b] = *after;
    return offset_a + (station - station_a) * (offset_b - offset_a) / (station_b - station_a);
  }

  /// Stations that cannot be of this alignment, as when its staStart is missing.
  void tell_outside(const Plan& plan, const std::vector<double>& stations, const std::string& track,
                    const std::string& what) {
    const double begin = plan.stations.front().first;
    const double end = plan.stations.back().first;
    std::vector<double> outside;
    std::copy_if(stations.begin(), stations.end(), std::back_inserter(outside),
                 [&](double station) { return station < begin - kToldOutsideM || station > end + kToldOutsideM; });
    if (outside.empty()) return;
    problem(track + ": " + std::to_string(outside.size()) + " of " + std::to_string(stations.size()) + " " + what +
            " stations lie outside the alignment, which reaches from " + told_number(begin, 3) + " to " +
            told_number(end, 3) + ": " + told_number(outside.front(), 3) +
            (outside.size() > 1 ? " to " + told_number(outside.back(), 3) : ""));
  }

  static bool is_profile_point(const pugi::xml_node& node) {
    const std::string_view kind = node.name();
    return kind == "PVI" || kind == "CircCurve" || kind == "ParaCurve";
  }

  /// Of the ground as it was before the track, by its own state or name or that of the <Profile> around it.
  static bool is_existing(const pugi::xml_node& profile) {
    for (const pugi::xml_node& node : {profile, profile.parent()}) {
      std::string name = node.attribute("name").value();
      std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
      if (std::string_view(node.attribute("state").value()) == "existing" || name.find("existing") != std::string::npos)
        return true;
    }
    return false;
  }

  /// The first that holds heights and is not of what existed before, else the first that holds heights.
  [[nodiscard]] pugi::xml_node choose_profile(const pugi::xml_node& alignment, const std::string& track) {
    std::vector<pugi::xml_node> all;
    for (const pugi::xml_node& profile : alignment.children("Profile")) {
      for (const pugi::xml_node& node : profile.children()) {
        const std::string_view kind = node.name();
        if (kind == "ProfAlign" || kind == "ProfSurf") all.push_back(node);
      }
    }
    std::vector<pugi::xml_node> usable;
    std::copy_if(all.begin(), all.end(), std::back_inserter(usable), [](const pugi::xml_node& node) {
      return std::string_view(node.name()) == "ProfAlign" && node.find_child(is_profile_point);
    });
    const auto design = std::find_if_not(usable.begin(), usable.end(), is_existing);
    pugi::xml_node chosen;
    if (!usable.empty()) chosen = design != usable.end() ? *design : usable.front();
    for (const pugi::xml_node& node : all) {
      if (node != chosen)
        problem(track + ": the <" + node.name() + "> \"" + node.attribute("name").value() + "\" in line " +
                source_.line_of(node) + " is not used");
    }
    return chosen;
  }

  [[nodiscard]] std::vector<GradePoint> read_profile(const pugi::xml_node& alignment, const std::string& track,
                                                     const Plan& plan) {
    std::vector<GradePoint> points;
    std::vector<double> stations;
    for (const pugi::xml_node& node : choose_profile(alignment, track).children()) {
      const std::string_view kind = node.name();
      if (!is_profile_point(node)) {
        if (node.type() == pugi::node_element)
          problem(track + ": <" + std::string(kind) + "> of the profile is left out");
        continue;
      }
      const std::vector<double> numbers = numbers_of(node.text().get());
      if (numbers.size() != 2)
        throw source_.wrong(
            node, "<" + std::string(kind) + "> needs a station and an elevation, not \"" + node.text().get() + "\"");
      const double length = kind == "PVI" ? 0.0 : source_.required(node, "length");
      if (length < 0) throw source_.wrong(node, "a vertical curve cannot have a negative length");
      if (!stations.empty() && numbers[0] <= stations.back())
        throw source_.wrong(node, "the profile's stations must grow");
      stations.push_back(numbers[0]);
      const GradePoint point{offset_at(plan, numbers[0]), numbers[1], length};
      if (!points.empty() && point.offset_m <= points.back().offset_m) {
        tell_step(points.back(), point, numbers[0], track);
      } else {
        points.push_back(point);
      }
    }
    for (size_t i = 1; i < points.size(); ++i) {
      const double used = 0.5 * (points[i - 1].curve_length_m + points[i].curve_length_m);
      if (used > points[i].offset_m - points[i - 1].offset_m + 0.01) {
        problem(track + ": the vertical curves at " + told_m(points[i - 1].offset_m) + " and " +
                told_m(points[i].offset_m) + " overlap");
      }
    }
    tell_outside(plan, stations, track, "profile");
    if (level_to_ends(points, plan.stations.back().second)) tell_reach(plan, stations, track);
    return points;
  }

  /// Of a profile that lies outside altogether more is told already.
  void tell_reach(const Plan& plan, const std::vector<double>& stations, const std::string& track) {
    const double begin = plan.stations.front().first;
    const double end = plan.stations.back().first;
    if (stations.front() > end + kToldOutsideM || stations.back() < begin - kToldOutsideM) return;
    problem(track + ": the profile reaches from " + told_number(stations.front(), 3) + " to " +
            told_number(stations.back(), 3) + ", the alignment from " + told_number(begin, 3) + " to " +
            told_number(end, 3) + "; it is level beyond: a guess");
  }

  /// The stations before and behind a jump are one place.
  void tell_step(const GradePoint& before, const GradePoint& behind, double station, const std::string& track) {
    const double step_m = std::abs(behind.elevation_m - before.elevation_m);
    if (step_m > kSameHeightM)
      problem(track + ": the profile's point at " + told_number(station, 3) +
              " is at the place of the one before it, " + told_m(step_m, 3) + " above or below; it is left out");
  }

  /// Applied cant is never negative in the file; the curve's direction says which rail is higher.
  [[nodiscard]] std::vector<CantPoint> read_cant(const pugi::xml_node& alignment, const std::string& track,
                                                 const Plan& plan) {
    std::vector<CantPoint> points;
    std::vector<double> stations;
    for (const pugi::xml_node& node : alignment.child("Cant").children("CantStation")) {
      const std::string_view direction = node.attribute("curvature").value();
      if (direction != "cw" && direction != "ccw") throw source_.wrong(node, "curvature must be cw or ccw");
      const double cant_m = source_.required(node, "appliedCant") * 1e-3 * (direction == "ccw" ? 1.0 : -1.0);
      stations.push_back(source_.required(node, "station"));
      points.push_back({offset_at(plan, stations.back()), cant_m});
      if (points.size() > 1 && points.back().offset_m < points[points.size() - 2].offset_m) {
        throw source_.wrong(node, "the cant stations must grow");
      }
    }
    tell_outside(plan, stations, track, "cant");
    if (runs_on(points, plan.elements))
      problem(track + ": the last cant station, " + told_number(stations.back(), 3) + ", has a cant of " +
              told_m(std::abs(points.back().cant_m), 3) + "; it holds up to the alignment's end at " +
              told_number(plan.stations.back().first, 3) + ": is a station with 0 missing?");
    return points;
  }

  void tell_unread(const pugi::xml_node& alignment, const std::string& track) {
    for (const char* part : {"CoordGeom", "Cant"}) {
      if (alignment.child(part).next_sibling(part))
        problem(track + ": it has more than one <" + part + ">; only the first is read");
    }
    if (alignment.child("StaEquation"))
      problem(track + ": station equations are not applied; stations count from its start");
  }

  void read_alignment(const pugi::xml_node& node) {
    const pugi::xml_node geometry = node.child("CoordGeom");
    const std::string name = node.attribute("name").as_string("alignment");
    if (!geometry) {
      problem(name + " in line " + source_.line_of(node) + " has no <CoordGeom>; it is left out");
      return;
    }
    Plan plan;
    plan.stations.push_back({source_.number(node, "staStart").value_or(0.0), 0.0});
    for (const pugi::xml_node& element : geometry.children()) {
      if (element.type() == pugi::node_element && std::string_view(element.name()) != "Feature")
        add_element(element, name, plan);
    }
    if (plan.elements.empty()) throw source_.wrong(geometry, "the alignment " + name + " has no elements");
    const double plan_length = plan.stations.back().first - plan.stations.front().first;
    if (const double told = source_.number(node, "length").value_or(plan_length); std::abs(told - plan_length) > 0.01) {
      problem(name + ": its elements cover " + told_m(plan_length) + " of the " + told_m(told) + " that it claims");
    }
    tell_unread(node, name);
    std::vector<GradePoint> profile = read_profile(node, name, plan);
    std::vector<CantPoint> cant = read_cant(node, name, plan);
    ImportedTrack track{.name = name, .line = name, .alignment = {}, .marks = {}};
    track.alignment = Alignment(std::move(plan.elements), std::move(plan.starts), std::move(profile), std::move(cant));
    out_.tracks.push_back(std::move(track));
  }

  [[nodiscard]] std::string find_crs(const pugi::xml_node& root) const {
    const std::string code = root.child("CoordinateSystem").attribute("epsgCode").value();
    if (!code.empty() && code.find_first_not_of("0123456789") == std::string::npos) return "EPSG:" + code;
    const bool swiss = std::all_of(out_.tracks.begin(), out_.tracks.end(), [](const ImportedTrack& track) {
      const PlanPose& start = track.alignment.starts().front();
      return start.easting_m > 2.48e6 && start.easting_m < 2.84e6 && start.northing_m > 1.07e6 &&
             start.northing_m < 1.30e6;
    });
    return swiss ? "EPSG:2056" : "";
  }

  XmlSource source_;
  LandXml out_;
};

}  // namespace

ClosedElement close_element(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double curvature_start_per_m,
                            double curvature_end_per_m, double length_m) {
  const Eigen::Vector2d chord = to - from;
  Element element{length_m, curvature_start_per_m, curvature_end_per_m};
  PlanPose drawn;
  // The chord is nearly as long as the element, so that scaling converges; a few rounds are enough for real tracks.
  for (int round = 0; round < 60; ++round) {
    drawn = advance({}, element, element.length_m);
    const double factor = chord.norm() / std::hypot(drawn.easting_m, drawn.northing_m);
    element.length_m *= factor;
    if (std::abs(factor - 1.0) < 1e-14) break;
  }
  drawn = advance({}, element, element.length_m);
  const double heading = std::atan2(chord.x(), chord.y()) - std::atan2(drawn.easting_m, drawn.northing_m);
  return {element, {from.x(), from.y(), core::wrap_pi(heading)}};
}

core::Result<LandXml> read_landxml(const std::filesystem::path& file) {
  try {
    return LandXmlReader(file).read();
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::track
