#include "track/import/build.hpp"

#include <algorithm>
#include <cerrno>
#include <fstream>

#include "core/whole_file.hpp"
#include "track/import/finish.hpp"
#include "track/import/local_crs.hpp"
#include "track/import/meeting.hpp"
#include "track/import/network.hpp"
#include "track/import/osm/osm_chains.hpp"
#include "track/import/osm/osm_network.hpp"
#include "track/import/scale.hpp"
#include "track/import/told.hpp"
#include "track/import/whereabouts.hpp"
#include "track/import/xml/erju.hpp"
#include "track/import/xml/landxml.hpp"
#include "track/import/xml/railml.hpp"
#include "track/import/xml/xml_root.hpp"

namespace railfix::track {
namespace {

constexpr double kSurveyFrogSigmaM = 0.5;  // the frog is drawn, not surveyed
constexpr double kPlanFrogSigmaM = 3.0;    // from coordinates every 10 m
constexpr double kMappingFrogSigmaM = 10.0;
constexpr double kSurveyLocationM = 1.0;  // Q_LOCACC
constexpr double kMappingLocationM = 5.0;

enum class Kind { landxml, osm, json, compiled, railml, erju_infra, erju_map };

core::Status check_readable(const std::filesystem::path& file) {
  std::error_code failed;
  const auto type = std::filesystem::status(file, failed).type();
  if (type == std::filesystem::file_type::directory) {
    errno = EISDIR;
    return core::cannot_read(file.string());
  }
  const bool special = type != std::filesystem::file_type::regular && std::filesystem::exists(file, failed);
  if (special) return core::Error{"cannot read " + file.string() + ": it is no file; is the path right?"};
  return std::ifstream(file) ? core::Status() : core::Status(core::cannot_read(file.string()));
}

/// By the name's ending; .xml by its first element.
core::Result<Kind> kind_of(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  const auto ends = [&](std::initializer_list<std::string_view> endings) {
    return std::any_of(endings.begin(), endings.end(), [&](std::string_view ending) { return name.ends_with(ending); });
  };
  if (const core::Status readable = check_readable(file); !readable) return readable.error();
  if (ends({".osm", ".pbf", ".osm.gz", ".osm.bz2", ".osm.xml"})) return Kind::osm;
  if (ends({".json", ".geojson"})) return Kind::json;
  if (ends({".landxml", ".LandXML"})) return Kind::landxml;
  if (ends({".map"})) return Kind::compiled;
  if (ends({".railml", ".railML"})) return Kind::railml;
  if (ends({".xml", ".XML"})) {
    const std::string root = xml_root(file);
    const auto holds = [&](const char* text) { return root.find(text) != std::string::npos; };
    if (holds("<osm")) return Kind::osm;
    if (holds("<railml") || holds("<railML")) return Kind::railml;
    if (holds("erju.org/infra")) return Kind::erju_infra;
    if (holds("erju.org/map")) return Kind::erju_map;
    return Kind::landxml;
  }
  return core::Error{
      file.string() +
      " is of no kind that can be read; give LandXML, railML or ERJU maps (.xml, .landxml, .railml), "
      "OpenStreetMap (.osm, .osm.gz, .osm.bz2, .pbf), Overpass JSON, GeoJSON (.json, .geojson) or a compiled map "
      "(.map)"};
}

std::vector<std::string> problems_of(const Map& map) {
  std::vector<std::string> found = check_topology(map);
  for (std::string problem : {whereabouts_problem(map), scale_problem(map)}) {
    if (!problem.empty()) found.push_back(std::move(problem));
  }
  return found;
}

void refuse_twice(const std::vector<std::filesystem::path>& inputs) {
  for (size_t i = 0; i < inputs.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      std::error_code failed;
      if (!std::filesystem::equivalent(inputs[i], inputs[j], failed)) continue;
      throw core::BadInput(inputs[i].string() + " is given twice: its tracks would lie on each other");
    }
  }
}

/// Everything that was read, before it becomes one map. Errors are thrown as BadInput and become a value at the door.
class Sources {
 public:
  explicit Sources(const BuildOptions& options) : options_(options) {}

  void read(const std::filesystem::path& file) {
    map_.source += (map_.source.empty() ? "" : ", ") + file.filename().string();
    switch (core::value_or_throw(kind_of(file))) {
      case Kind::landxml:
        take(core::value_or_throw(read_landxml(file)), file);
        break;
      case Kind::osm:
        take(core::value_or_throw(read_osm(file, options_.with_trams)), file);
        break;
      case Kind::json:
        take(core::value_or_throw(read_osm_json(file, options_.with_trams)), file);
        break;
      case Kind::railml:
        take(core::value_or_throw(read_railml(file)), file);
        break;
      case Kind::erju_infra:
        if (erju_infra_)
          throw core::BadInput("only one ERJU infrastructure can be read; " + file.string() + " is the second");
        erju_infra_ = file;
        break;
      case Kind::erju_map:
        if (erju_map_) throw core::BadInput("only one ERJU map can be read; " + file.string() + " is the second");
        erju_map_ = file;
        break;
      case Kind::compiled:
        take(core::value_or_throw(Map::load(file)), file);
        break;
    }
  }

  BuiltMap finish() {
    if (erju_map_ && !erju_infra_)
      throw core::BadInput(erju_map_->string() +
                           " holds coordinates only; give the ERJU infrastructure file (infra) too");
    if (erju_infra_) {
      take(core::value_or_throw(read_erju(*erju_infra_, erju_map_ ? &*erju_map_ : nullptr)), *erju_infra_);
    }
    choose_crs();
    for (RailNet& net : nets_) {
      const bool is_surveyed = !net.crs.empty();
      const size_t first_node = add(draft_of(net));
      if (is_surveyed) add_frogs(map_, kPlanFrogSigmaM, first_node);
      std::move(net.problems.begin(), net.problems.end(), std::back_inserter(map_.problems));
      out_.plans.include(net.figures);
      take(std::move(net.fit));
    }
    if (!tracks_.empty()) add_frogs(map_, kSurveyFrogSigmaM, add(cut_tracks(std::move(tracks_), cuts_)));
    const size_t surveyed_edges = map_.edges.size();
    if (!osm_.ways.empty() || map_.edges.empty()) add_osm();
    check_crs();
    const bool all_surveyed = surveyed_edges == map_.edges.size();
    map_.q_locacc_m = std::max(map_.q_locacc_m, all_surveyed ? kSurveyLocationM : kMappingLocationM);
    for (BaliseGroup& group : map_.balise_groups) {
      if (group.q_locacc_m == kUnsaidLocationM) group.q_locacc_m = options_.q_locacc_m;
    }
    add_virtual_groups();
    if (!options_.landmarks.empty()) core::ok_or_throw(keep_landmarks(map_, options_.landmarks));
    tell_not_joined();
    std::ranges::move(problems_of(map_), std::back_inserter(cuts_));
    std::ranges::move(map_.problems, std::back_inserter(cuts_));
    map_.problems = std::move(cuts_);
    out_.map = std::move(map_);
    return std::move(out_);
  }

 private:
  /// The index of its first node.
  size_t add(const Draft& draft) {
    const size_t first = map_.nodes.size();
    const size_t first_edge = map_.edges.size();
    append(draft, map_);
    if (first_edge > 0) not_joined_ += ends_on_edges_before(map_, first_edge);
    return first;
  }

  void tell_not_joined() {
    if (not_joined_ == 0) return;
    cuts_.insert(cuts_.begin(), std::to_string(not_joined_) +
                                    " ends of one input's tracks lie on those of another and are not joined: only "
                                    "OpenStreetMap data among themselves, and plans in LandXML, are. Build the map "
                                    "anew from its sources; loose ends, switches of two tracks and parts out of reach "
                                    "come of it, too");
  }

  void take(LandXml read, const std::filesystem::path& file) {
    want_crs(read.crs, file);
    std::move(read.tracks.begin(), read.tracks.end(), std::back_inserter(tracks_));
    std::move(read.problems.begin(), read.problems.end(), std::back_inserter(map_.problems));
    out_.landxml.include(read.figures);
  }

  void take(RailNet read, const std::filesystem::path& file) {
    want_crs(read.crs, file);
    nets_.push_back(std::move(read));
  }

  void take(FitReport read) {
    FitReport& all = out_.fit;
    std::move(read.elements.begin(), read.elements.end(), std::back_inserter(all.elements));
    all.tracks += read.tracks;
    all.left_as_arcs += read.left_as_arcs;
    all.two_points += read.two_points;
    all.left_out += read.left_out;
    all.arcs_m += read.arcs_m;
    all.points += read.points;
    all.squared_sum_m2 += read.squared_sum_m2;
    all.max_m = std::max(all.max_m, read.max_m);
  }

  void take(OsmData read, const std::filesystem::path& file) {
    if (const auto middle = middle_of(read)) places_.push_back({file.filename().string(), *middle});
    osm_.nodes.merge(read.nodes);
    // GeoJSON has lines in one file and points in another.
    for (auto& [id, node] : read.nodes) {
      OsmNode& known = osm_.nodes.at(id);
      if (known.tags.empty()) known.tags = std::move(node.tags);
    }
    std::move(read.ways.begin(), read.ways.end(), std::back_inserter(osm_.ways));
    std::move(read.bridges.begin(), read.bridges.end(), std::back_inserter(osm_.bridges));
    std::move(read.platforms.begin(), read.platforms.end(), std::back_inserter(osm_.platforms));
    std::move(read.problems.begin(), read.problems.end(), std::back_inserter(cuts_));
  }

  void take(Map read, const std::filesystem::path& file) {
    if (!map_.edges.empty())
      throw core::BadInput("only one compiled map can be built upon; " + file.string() + " is the second");
    want_crs(read.crs, file);
    read.source = map_.source;
    if (!(read.q_locacc_m > 0)) read.q_locacc_m = kMappingLocationM;
    std::move(map_.problems.begin(), map_.problems.end(), std::back_inserter(read.problems));
    map_ = std::move(read);
    // What the check finds is found anew.
    const std::vector<std::string> found = problems_of(map_);
    std::erase_if(map_.problems,
                  [&](const std::string& p) { return std::find(found.begin(), found.end(), p) != found.end(); });
  }

  void want_crs(const std::string& crs, const std::filesystem::path& file) {
    if (has_plane_source_ && crs != source_crs_) {
      throw core::BadInput(file.string() + " is in " + (crs.empty() ? "an unnamed coordinate system" : crs) +
                           " but the sources before it are in " +
                           (source_crs_.empty() ? "an unnamed one" : source_crs_) + "; build one map of each");
    }
    source_crs_ = crs;
    if (!has_plane_source_) plane_source_ = file.filename().string();
    has_plane_source_ = true;
  }

  void choose_crs() {
    map_.crs = options_.crs;
    if (has_plane_source_) {
      if (map_.crs == "local")
        throw core::BadInput("--crs local is for OpenStreetMap data only; a plan keeps its own system");
      if (!map_.crs.empty() && !source_crs_.empty() && map_.crs != source_crs_) {
        throw core::BadInput("the plan is in " + source_crs_ + " and is not reprojected; leave --crs " + map_.crs +
                             " out");
      }
      if (map_.crs.empty()) {
        map_.crs = source_crs_;
      } else if (source_crs_.empty()) {
        out_.crs_remark = plane_source_ +
                          " names no coordinate system: its coordinates stay as they are and are taken as " + map_.crs +
                          "'s";
      }
    } else if (const std::optional<GeoPoint> middle = middle_of(osm_)) {
      if (map_.crs.empty()) map_.crs = utm_crs(*middle);
      if (map_.crs == "local") map_.crs = local_crs(*middle);
    }
    if (!map_.crs.empty() && map_.crs != "local") static_cast<void>(core::value_or_throw(Projection::open(map_.crs)));
  }

  void add_virtual_groups() {
    core::ok_or_throw(
        add_virtual_balises_at(map_, options_.virtual_balises_at, options_.virtual_numbers, map_.q_locacc_m));
    if (options_.virtual_balises_every_m > 0) {
      out_.virtual_balises = core::value_or_throw(
          add_virtual_balises(map_, options_.virtual_balises_every_m, options_.virtual_numbers, map_.q_locacc_m));
    }
    out_.virtual_balises.groups += options_.virtual_balises_at.size();
  }

  // A drawing lies nowhere on the Earth.
  void check_crs() {
    const bool drawn = !map_.edges.empty() && std::ranges::all_of(map_.edges, &Edge::is_drawn);
    if (drawn && !map_.crs.empty())
      throw core::BadInput("no track has coordinates: the map is a drawing and lies nowhere in " + map_.crs +
                           "; leave --crs out");
    if (!map_.crs.empty() || !has_plane_source_) return;
    map_.problems.push_back(
        drawn ? "the map is a drawing: it has no latitudes and longitudes, and GNSS says nothing on it"
              : "the coordinate system is not known; give --crs to get latitudes and longitudes");
  }

  void add_osm() {
    if (osm_.ways.empty())
      throw core::BadInput(
          "the inputs hold no railway tracks (railway=rail, light_rail, narrow_gauge or subway; --trams adds trams)" +
          (cuts_.empty() ? "" : "; " + cuts_.front()));
    if (const std::string lack = lack_of_nodes(osm_); !lack.empty())
      throw core::BadInput(lack + (cuts_.empty() ? "" : "; " + cuts_.front()));
    if (map_.crs.empty() || map_.crs == "local")
      throw core::BadInput("OpenStreetMap data need a coordinate system; give --crs");
    if (const auto middle = middle_on_earth(map_)) places_.insert(places_.begin(), {plane_source_, *middle});
    std::ranges::move(told_apart(places_), std::back_inserter(cuts_));
    const Projection projection = core::value_or_throw(Projection::open(map_.crs));
    auto built = build_osm_network(osm_, projection, options_.smooth_m, options_.with_clothoids);
    if (!built.ok()) {  // whereabouts_problem() says it of a map
      const std::optional<GeoPoint> middle = middle_of(osm_);
      const std::string elsewhere = middle ? told_swapped(*middle, projection, map_.crs) : "";
      if (!elsewhere.empty()) throw core::BadInput(built.error().message + "; " + elsewhere);
    }
    OsmNetwork network = core::value_or_throw(std::move(built));
    add_frogs(map_, kMappingFrogSigmaM, add(network.draft));
    std::ranges::move(network.cuts, std::back_inserter(cuts_));
    std::ranges::move(network.problems, std::back_inserter(map_.problems));
    out_.osm.include(network.figures);
    take(std::move(network.fit));
  }

  const BuildOptions& options_;
  Map map_;
  std::vector<ImportedTrack> tracks_;
  std::vector<RailNet> nets_;
  std::optional<std::filesystem::path> erju_infra_;
  std::optional<std::filesystem::path> erju_map_;
  OsmData osm_;
  std::vector<InputPlace> places_;  // of what lies in latitude and longitude
  size_t not_joined_ = 0;           // ends of what was added on what was there before
  std::string source_crs_;
  std::string plane_source_;  // the first one's file
  bool has_plane_source_ = false;
  std::vector<std::string> cuts_;  // of what was read: what extracts lack and ends that meet no other; told first
  BuiltMap out_;
};

}  // namespace

core::Result<BuiltMap> build_map(const std::vector<std::filesystem::path>& inputs, const BuildOptions& options) {
  try {
    Sources sources(options);
    refuse_twice(inputs);
    for (const std::filesystem::path& input : inputs) sources.read(input);
    BuiltMap built = sources.finish();
    built.map.name = inputs.empty() ? "" : inputs.front().stem().string();
    return built;
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::track
