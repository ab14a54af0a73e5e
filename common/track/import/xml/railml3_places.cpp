#include "track/import/xml/railml3_places.hpp"

#include <algorithm>

#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

/// By the first system that has two measures on the net element.
std::optional<bool> mileage_falls_along(const XmlSource& source, const pugi::xml_node& element) {
  std::map<std::string, std::pair<double, double>> first_of;  // system: place, measure
  for (const pugi::xml_node& place : descendants(element, "intrinsicCoordinate")) {
    const auto along = source.number(place, "intrinsicCoord");
    for (const pugi::xml_node& coordinate : place.children("linearCoordinate")) {
      const auto measure = source.number(coordinate, "measure");
      if (!along || !measure) continue;
      const std::string system = coordinate.attribute("positioningSystemRef").value();
      const auto [first, is_new] = first_of.try_emplace(system, *along, *measure);
      const auto& [first_along, first_measure] = first->second;
      if (!is_new && *along != first_along && *measure != first_measure)
        return (*along > first_along) != (*measure > first_measure);
    }
  }
  return std::nullopt;
}

}  // namespace

void Railml3Places::add_track(const pugi::xml_node& element, size_t track) {
  const std::string id = source_.required_text(element, "id");
  if (!track_of_.emplace(id, track).second) throw source_.wrong(element, "net element \"" + id + "\" is there twice");
  if (const auto falls = mileage_falls_along(source_, element)) mileage_falls_[track] = *falls;
}

std::optional<size_t> Railml3Places::track(const std::string& net_element) const {
  const auto found = track_of_.find(net_element);
  return found == track_of_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<size_t> Railml3Places::find_track(const pugi::xml_node& of, const pugi::xml_node& location) {
  const std::string id = location.attribute("netElementRef").value();
  const std::optional<size_t> found = track(id);
  if (!found && !is_coarse(id)) tell_missing(of, "net element", id, "it is left out there");
  return found;
}

void Railml3Places::tell_missing(const pugi::xml_node& of, const std::string& kind, const std::string& id,
                                 const std::string& therefore) {
  net_.problems.push_back(railml_called(of) + " names the " + kind + " \"" + id + "\", which does not exist; " +
                          therefore);
}

bool Railml3Places::is_beyond(const pugi::xml_node& of, double from_m, double to_m, double length_m) {
  const bool beyond = to_m < -kNetTouchM || from_m > length_m + kNetTouchM;
  if (beyond) tell_beyond(of, from_m, length_m, "it is left out there");
  return beyond;
}

void Railml3Places::tell_beyond(const pugi::xml_node& of, double at_m, double length_m, const std::string& therefore) {
  net_.problems.push_back(railml_called(of) + " lies at " + told_m(at_m) + " of a net element of " + told_m(length_m) +
                          "; " + therefore);
}

double Railml3Places::within(const pugi::xml_node& of, double at_m, double length_m) {
  if (at_m < -kNetTouchM || at_m > length_m + kNetTouchM) tell_beyond(of, at_m, length_m, "it is put to its end");
  return std::clamp(at_m, 0.0, length_m);
}

bool Railml3Places::has_location(const pugi::xml_node& node) {
  return !descendants(node, "associatedNetElement").empty() || !descendants(node, "spotLocation").empty();
}

std::vector<NetPlace> Railml3Places::of(const pugi::xml_node& node) {
  std::vector<NetPlace> out;
  const auto parts = descendants(node, "associatedNetElement");
  const auto spots = descendants(node, "spotLocation");
  if (!has_location(node)) net_.problems.push_back(railml_called(node) + " has no location; it is left out");
  for (const pugi::xml_node& part : parts) {
    const std::optional<size_t> track = find_track(node, part);
    if (!track) continue;
    const double length = net_.tracks[*track].length_m;
    const auto along_m = [&](const char* pos, const char* part_of_length, double otherwise) {
      const double share = source_.number(part, part_of_length).value_or(otherwise);
      return source_.number(part, pos).value_or(share * length);
    };
    const double from = along_m("posBegin", "intrinsicCoordBegin", 0);
    const double to = along_m("posEnd", "intrinsicCoordEnd", 1);
    const auto [first, last] = std::minmax(from, to);
    if (is_beyond(node, first, last, length)) continue;
    const bool turned = std::string(part.attribute("keepsOrientation").value()) == "false";
    out.push_back({*track, within(node, first, length), within(node, last, length), from <= to && !turned});
  }
  if (!out.empty()) return out;
  for (const pugi::xml_node& spot : spots) {
    const std::optional<size_t> track = find_track(node, spot);
    if (!track) continue;
    const double length = net_.tracks[*track].length_m;
    const auto along = source_.number(spot, "intrinsicCoord");
    const double told_m = source_.number(spot, "pos").value_or(along.value_or(0) * length);
    if (is_beyond(node, told_m, told_m, length)) continue;
    const double at = std::clamp(told_m, 0.0, length);
    out.push_back({*track, at, at, std::string(spot.attribute("applicationDirection").value()) != "reverse"});
  }
  return out;
}

}  // namespace railfix::track
