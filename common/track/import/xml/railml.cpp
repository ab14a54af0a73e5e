#include "track/import/xml/railml.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {

std::string railml_name(const pugi::xml_node& node) {
  for (const char* attribute : {"name", "code"}) {
    const std::string text = node.attribute(attribute).value();
    if (!text.empty()) return text;
  }
  const std::string named = node.child("name").attribute("name").value();
  return named.empty() ? std::string(node.attribute("id").value()) : named;
}

std::string railml_called(const pugi::xml_node& node) {
  return "<" + std::string(node.name()) + "> \"" + railml_name(node) + "\"";
}

std::string railml_has(const pugi::xml_node& node, const NetTrack& track, const char* attribute,
                       const std::string& why) {
  return railml_called(node) + " of track " + track.track.name + " has " + attribute + " " +
         node.attribute(attribute).value() + " " + why;
}

bool is_on_track(double offset_m, double length_m) {
  return offset_m >= -kAtEndM && offset_m <= length_m + kAtEndM;
}

std::string not_on_its_track(const pugi::xml_node& node) {
  return railml_called(node) + " is not on its track; it is left out";
}

double left_of(const std::string& side) {
  if (side != "left" && side != "right") return 0;
  return side == "left" ? 1 : -1;
}

std::set<std::string> special_speed_profiles(const XmlSource& source) {
  std::set<std::string> out;
  for (const pugi::xml_node& profile : descendants(source.root(), "speedProfile")) {
    const std::string is_basic = profile.attribute("isBasicSpeedProfile").value();
    const std::string influence = profile.attribute("influence").value();
    if (is_basic == "false" || (is_basic.empty() && influence == "decreasing"))
      out.insert(profile.attribute("id").value());
  }
  return out;
}

std::optional<EtcsIdentity> etcs_identity(const XmlSource& source, const pugi::xml_node& group) {
  std::vector<pugi::xml_node> places{group};
  for (const pugi::xml_node& child : group.children()) places.push_back(child);
  for (const pugi::xml_node& place : places) {
    for (const auto& [country, number] :
         {std::pair("countryID", "groupID"), std::pair("nid_c", "nid_bg"), std::pair("nidC", "nidBG")}) {
      const auto c = source.number(place, country);
      const auto bg = source.number(place, number);
      if (!c || !bg) continue;
      const auto identity = etcs_identity(*c, *bg);
      if (!identity) throw source.wrong(place, "balise group \"" + railml_name(group) + "\" has " + kNoEtcsIdentity);
      return identity;
    }
  }
  return std::nullopt;
}

std::string balise_group_of(const pugi::xml_node& balise) {
  for (const char* attribute : {"baliseGroupRef", "belongsToBaliseGroup"}) {
    const std::string group = balise.attribute(attribute).value();
    if (!group.empty()) return group;
  }
  return balise.child("belongsToBaliseGroup").attribute("ref").value();
}

std::optional<bool> nominal_by_order(const std::vector<TrackMark>& balises) {
  const auto other = std::find_if(balises.begin(), balises.end(), [&](const TrackMark& balise) {
    return std::abs(balise.offset_m - balises.front().offset_m) > kAtEndM;
  });
  if (other == balises.end()) return std::nullopt;
  return other->offset_m > balises.front().offset_m;
}

namespace {

/// An id names one element of a file; references to one that is there twice lead to either.
void tell_repeated_ids(const XmlSource& source, std::vector<std::string>& problems) {
  struct Ids : pugi::xml_tree_walker {
    std::map<std::string, pugi::xml_node> first;
    std::vector<std::string>* problems = nullptr;
    bool for_each(pugi::xml_node& at) override {
      const std::string id = at.attribute("id").value();
      if (id.empty()) return true;
      const auto [entry, is_new] = first.try_emplace(id, at);
      if (!is_new)
        problems->push_back("the id \"" + id + "\" is there twice, for " + called(entry->second) + " and for " +
                            called(at));
      return true;
    }
    static std::string called(const pugi::xml_node& node) {
      const std::string at = node.attribute("pos").value();
      return railml_called(node) + (at.empty() ? "" : " at " + at + " m");
    }
  } ids;
  ids.problems = &problems;
  source.root().traverse(ids);
}

/// Groups of one identity of which not all are on the map, where the check of maps finds those.
void tell_repeated_identities(const XmlSource& source, RailNet& net) {
  std::map<EtcsIdentity, std::vector<pugi::xml_node>> groups_of;
  std::map<EtcsIdentity, size_t> on_map;
  for (const NetTrack& track : net.tracks) {
    for (const TrackGroup& group : track.track.groups) ++on_map[{group.nid_c, group.nid_bg}];
  }
  for (const pugi::xml_node& group : descendants(source.root(), "baliseGroup")) {
    if (const auto identity = etcs_identity(source, group)) groups_of[*identity].push_back(group);
  }
  for (const auto& [identity, groups] : groups_of) {
    if (groups.size() < 2 || on_map[identity] == groups.size()) continue;
    net.problems.push_back(railml_called(groups[0]) + " and " + railml_called(groups[1]) + " have one identity, " +
                           std::to_string(identity.nid_c) + "/" + std::to_string(identity.nid_bg) +
                           ": one of them has a wrong one");
  }
}

RailNet read_version(const XmlSource& source) {
  const std::string name = source.root().name();
  const std::string version = source.root().attribute("version").value();
  if (name == "railml" && version.starts_with("2.")) return read_railml2(source);
  if (name == "railML" && version.starts_with("3.")) return read_railml3(source);
  throw core::BadInput(source.file_name() + " is <" + name + "> version \"" + version +
                       "\"; railML 2.x and 3.x can be read");
}

}  // namespace

core::Result<RailNet> read_railml(const std::filesystem::path& file) {
  try {
    const XmlSource source(file);
    RailNet net = read_version(source);
    tell_repeated_ids(source, net.problems);
    tell_repeated_identities(source, net);
    return net;
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::track
