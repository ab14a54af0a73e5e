#include "track/import/xml/railml2_balises.hpp"

#include <algorithm>
#include <map>

#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

struct Railml2PlacedBalise {
  TrackMark mark;
  pugi::xml_node node;
};

class Railml2BaliseReader {
 public:
  Railml2BaliseReader(const XmlSource& source, NetTrack& track, std::vector<std::string>& problems)
      : source_(source), track_(track), problems_(problems) {}

  void read(const pugi::xml_node& balises, double origin_m) {
    for (const pugi::xml_node& balise : balises.children("balise")) read_balise(balise, origin_m);
    for (const pugi::xml_node& group : balises.children("baliseGroup")) read_group(group);
    for (const auto& [id, balise] : by_id_) track_.track.marks.push_back(balise.mark);  // in no group
  }

 private:
  void read_balise(const pugi::xml_node& balise, double origin_m) {
    const double at_m = source_.required(balise, "pos") - origin_m;
    if (!is_on_track(at_m, track_.length_m)) {
      problems_.push_back(not_on_its_track(balise));
      return;
    }
    const TrackMark mark{LandmarkKind::balise, std::clamp(at_m, 0.0, track_.length_m), 0, kRailmlSigmaM,
                         railml_name(balise)};
    // A second one of that id is told for the whole file; it belongs to no group.
    if (!by_id_.emplace(balise.attribute("id").value(), Railml2PlacedBalise{mark, balise}).second)
      track_.track.marks.push_back(mark);
  }

  void read_group(const pugi::xml_node& node) {
    const std::optional<EtcsIdentity> identity = etcs_identity(source_, node);
    bool has_reference = true;
    const std::vector<Railml2PlacedBalise> balises = balises_of(node, has_reference);
    if (balises.empty()) {
      tell(node, "has no balises on its track");
    } else if (!identity) {
      tell(node, "has no ETCS identity (countryID and groupID); its balises are kept as landmarks");
      keep_as_landmarks(balises);
    } else if (!has_reference) {
      tell(node, "lacks its first balise, which its place counts from; its other balises are kept as landmarks");
      keep_as_landmarks(balises);
    } else {
      add_group(node, *identity, balises);
    }
  }

  /// In the order of the group. Takes them out of those that belong to none.
  std::vector<Railml2PlacedBalise> balises_of(const pugi::xml_node& group, bool& has_reference) {
    std::vector<std::pair<double, std::string>> order;
    for (const pugi::xml_node& ref : group.children("baliseRef"))
      order.emplace_back(source_.number(ref, "sequence").value_or(0), ref.attribute("ref").value());
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    has_reference = order.empty() || order.front().first <= kLastReferenceNumber;
    std::vector<Railml2PlacedBalise> balises;
    for (const auto& [sequence, id] : order) {
      const auto found = by_id_.find(id);
      if (found == by_id_.end()) {
        tell(group, "names the balise \"" + id + "\", which is not on its track or in another group; it goes without");
        has_reference = has_reference && !balises.empty();
        continue;
      }
      balises.push_back(found->second);
      by_id_.erase(found);
    }
    return balises;
  }

  void add_group(const pugi::xml_node& node, const EtcsIdentity& identity,
                 const std::vector<Railml2PlacedBalise>& balises) {
    const double at_m = balises.front().mark.offset_m;
    TrackGroup group{identity.nid_c, identity.nid_bg, at_m, true, kUnsaidLocationM, {}};
    for (const Railml2PlacedBalise& balise : balises) group.balises.push_back(balise.mark);
    const std::string direction = balises.front().node.attribute("dir").value();
    if (const std::optional<bool> ordered = nominal_by_order(group.balises)) {
      group.nominal_is_forward = *ordered;
    } else if (direction == "up" || direction == "down") {
      group.nominal_is_forward = direction == "up";
    } else {
      tell(node,
           "says no direction: it has no balises at two places, nor one with \"dir\" up or down; its balises are kept "
           "as landmarks");
      return keep_as_landmarks(balises);
    }
    track_.track.groups.push_back(std::move(group));
  }

  void keep_as_landmarks(const std::vector<Railml2PlacedBalise>& balises) {
    for (const Railml2PlacedBalise& balise : balises) track_.track.marks.push_back(balise.mark);
  }

  void tell(const pugi::xml_node& group, const std::string& what) {
    problems_.push_back("balise group \"" + railml_name(group) + "\" " + what);
  }

  const XmlSource& source_;
  NetTrack& track_;
  std::vector<std::string>& problems_;
  std::map<std::string, Railml2PlacedBalise> by_id_;  // on the track, in no group yet
};

}  // namespace

void read_balises2(const XmlSource& source, const pugi::xml_node& balises, double origin_m, NetTrack& track,
                   std::vector<std::string>& problems) {
  Railml2BaliseReader(source, track, problems).read(balises, origin_m);
}

}  // namespace railfix::track
