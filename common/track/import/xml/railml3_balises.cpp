#include "track/import/xml/railml3_balises.hpp"

#include <algorithm>

#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

struct Railml3PlacedBalise {
  NetPlace place;
  pugi::xml_node node;
  std::optional<double> number;  // in its group

  [[nodiscard]] TrackMark mark() const {
    return {LandmarkKind::balise, place.from_m, 0, kRailmlSigmaM, railml_name(node)};
  }
};

class Railml3BaliseReader {
 public:
  Railml3BaliseReader(const XmlSource& source, Railml3Places& places, RailNet& net)
      : source_(source), places_(places), net_(net) {}

  void read() {
    const std::vector<pugi::xml_node> groups = descendants(source_.root(), "baliseGroup");
    for (const pugi::xml_node& group : groups) of_group_[group.attribute("id").value()];
    for (const pugi::xml_node& balise : descendants(source_.root(), "balise")) read_balise(balise);
    for (const pugi::xml_node& group : groups) read_group(group);
  }

 private:
  void read_balise(const pugi::xml_node& balise) {
    const std::vector<NetPlace> places = places_.of(balise);
    if (places.empty()) return;
    const std::string group = balise_group_of(balise);
    const auto known = of_group_.find(group);
    if (group.empty() || known == of_group_.end()) {
      if (!group.empty()) places_.tell_missing(balise, "balise group", group, "it is kept as a landmark");
      keep_as_landmark({places.front(), balise, {}});
      return;
    }
    std::optional<double> number = source_.number(balise, "positionInGroup");
    for (const pugi::xml_node& child : balise.children()) {
      if (!number) number = source_.number(child, "positionInGroup");
    }
    known->second.push_back({places.front(), balise, number});
  }

  void read_group(const pugi::xml_node& node) {
    const auto identity = etcs_identity(source_, node);
    std::vector<Railml3PlacedBalise>& balises = of_group_[node.attribute("id").value()];
    std::vector<NetPlace> own;
    if (balises.empty() || places_.has_location(node)) own = places_.of(node);
    if (balises.empty() && !own.empty()) balises.push_back({own.front(), node, {}});
    if (balises.empty()) {
      tell(node, "has no place on a track, nor has a balise of it; it is left out");
      return;
    }
    if (!identity) {
      return keep_as_landmarks(node, balises,
                               "has no ETCS identity (countryID and groupID); its balises are kept as landmarks");
    }
    std::stable_sort(balises.begin(), balises.end(), [](const Railml3PlacedBalise& a, const Railml3PlacedBalise& b) {
      return a.number && (!b.number || *a.number < *b.number);
    });
    if (balises.front().number.value_or(0) > kLastReferenceNumber) {
      return keep_as_landmarks(
          node, balises, "has no balise number 0 or 1, which its place counts from; its balises are kept as landmarks");
    }
    if (is_order_open(node, balises)) {
      return keep_as_landmarks(
          node, balises,
          "is reversed and lies on two net elements, and no numbers say which balise is its first; they are kept "
          "as landmarks");
    }
    const std::optional<bool> said = said_direction(node, balises);
    if (said) sort_by_place(balises, *said);
    add_group(node, *identity, balises, said);
  }

  /// Without numbers the first one of the file is the first in nominal direction, unless that is said to be another.
  static bool is_order_open(const pugi::xml_node& of, const std::vector<Railml3PlacedBalise>& balises) {
    const Railml3PlacedBalise& first = balises.front();
    return !first.number && std::string(of.attribute("mileageDirection").value()) == "reverse" &&
           std::ranges::any_of(balises,
                               [&](const Railml3PlacedBalise& b) { return b.place.track != first.place.track; });
  }

  /// Balises without numbers lie in the nominal direction, one after the other.
  static void sort_by_place(std::vector<Railml3PlacedBalise>& balises, bool forward) {
    const size_t track = balises.front().place.track;
    if (std::any_of(balises.begin(), balises.end(),
                    [&](const Railml3PlacedBalise& balise) { return balise.number || balise.place.track != track; }))
      return;
    std::stable_sort(balises.begin(), balises.end(), [&](const Railml3PlacedBalise& a, const Railml3PlacedBalise& b) {
      return forward ? a.place.from_m < b.place.from_m : a.place.from_m > b.place.from_m;
    });
  }

  /// A group lies on one track, that of its reference balise.
  void add_group(const pugi::xml_node& of, const EtcsIdentity& identity,
                 const std::vector<Railml3PlacedBalise>& balises, const std::optional<bool>& said) {
    const NetPlace& first = balises.front().place;
    ImportedTrack& track = net_.tracks[first.track].track;
    std::vector<TrackMark> here;
    for (const Railml3PlacedBalise& balise : balises) {
      if (balise.place.track == first.track) here.push_back(balise.mark());
    }
    const std::optional<bool> forward = nominal_is_forward(of, here, balises, said);
    if (!forward) {
      return keep_as_landmarks(
          of, balises,
          "says no direction: it has no mileageDirection, nor balises at two places; its balises are kept as "
          "landmarks");
    }
    for (const Railml3PlacedBalise& balise : balises) {
      if (balise.place.track != first.track) keep_as_landmark(balise);
    }
    if (here.size() < balises.size())
      tell(of, "lies on two net elements; only its balises on \"" + track.name +
                   "\" are kept in it, the others as landmarks");
    track.groups.push_back(
        {identity.nid_c, identity.nid_bg, first.from_m, *forward, kUnsaidLocationM, std::move(here)});
  }

  /// By the file's word, else by the order of the balises, else by the direction that they apply to.
  std::optional<bool> nominal_is_forward(const pugi::xml_node& of, const std::vector<TrackMark>& here,
                                         const std::vector<Railml3PlacedBalise>& balises,
                                         const std::optional<bool>& said) {
    // Numbers say the order for certain, that of the file only where nobody else says the direction.
    const bool numbered =
        std::ranges::all_of(balises, [](const Railml3PlacedBalise& balise) { return balise.number.has_value(); });
    const std::optional<bool> ordered = nominal_by_order(here);
    if (said) {
      if (numbered && ordered && *ordered != *said)
        tell(of, "has a mileageDirection against the numbers of its balises; the mileageDirection is taken");
      return *said;
    }
    if (numbered && ordered) return ordered;
    const std::optional<bool> applied = applied_direction(of, balises);
    return applied ? applied : ordered;
  }

  /// By mileageDirection, turned where the mileage falls along the track or, where it says none, the place is told
  /// against it.
  std::optional<bool> said_direction(const pugi::xml_node& of, const std::vector<Railml3PlacedBalise>& balises) {
    const std::string direction = of.attribute("mileageDirection").value();
    if (direction != "nominal" && direction != "reverse") return std::nullopt;
    const size_t track = balises.front().place.track;
    const auto falls = places_.mileage_falls(track);
    return (direction == "nominal") != (falls ? *falls : is_told_against(of, track));
  }

  [[nodiscard]] bool is_told_against(const pugi::xml_node& of, size_t track) const {
    return std::ranges::any_of(descendants(of, "associatedNetElement"), [&](const pugi::xml_node& part) {
      return places_.track(part.attribute("netElementRef").value()) == track &&
             std::string(part.attribute("keepsOrientation").value()) == "false";
    });
  }

  [[nodiscard]] std::optional<bool> applied_direction(const pugi::xml_node& of,
                                                      const std::vector<Railml3PlacedBalise>& balises) const {
    for (const pugi::xml_node& node : {of, balises.front().node}) {
      for (const pugi::xml_node& spot : descendants(node, "spotLocation")) {
        if (places_.track(spot.attribute("netElementRef").value()) != balises.front().place.track) continue;
        const std::string applies = spot.attribute("applicationDirection").value();
        if (applies == "normal" || applies == "reverse") return applies == "normal";
      }
    }
    return std::nullopt;
  }

  void keep_as_landmarks(const pugi::xml_node& group, const std::vector<Railml3PlacedBalise>& balises,
                         const std::string& because) {
    tell(group, because);
    for (const Railml3PlacedBalise& balise : balises) keep_as_landmark(balise);
  }

  void keep_as_landmark(const Railml3PlacedBalise& balise) {
    net_.tracks[balise.place.track].track.marks.push_back(balise.mark());
  }

  void tell(const pugi::xml_node& group, const std::string& what) {
    net_.problems.push_back("balise group \"" + railml_name(group) + "\" " + what);
  }

  const XmlSource& source_;
  Railml3Places& places_;
  RailNet& net_;
  std::map<std::string, std::vector<Railml3PlacedBalise>> of_group_;
};

}  // namespace

void read_balises3(const XmlSource& source, Railml3Places& places, RailNet& net) {
  Railml3BaliseReader(source, places, net).read();
}

}  // namespace railfix::track
