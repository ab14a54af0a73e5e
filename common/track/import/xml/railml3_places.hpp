// Where things lie on the net elements of railML 3.
#pragma once

#include <map>
#include <optional>
#include <set>

#include "track/import/xml/net_places.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

class Railml3Places {
 public:
  Railml3Places(const XmlSource& source, RailNet& net) : source_(source), net_(net) {}

  /// A net element that is a track of the net. Throws core::BadInput where it is there twice.
  void add_track(const pugi::xml_node& element, size_t track);
  /// Net elements made of others, and relations between them.
  void add_coarse(const std::string& id) { coarse_.insert(id); }
  [[nodiscard]] bool is_coarse(const std::string& id) const { return coarse_.contains(id); }

  /// Nothing where the net element is coarse or does not exist.
  [[nodiscard]] std::optional<size_t> track(const std::string& net_element) const;
  /// Whether the file's mileage falls along the track; nothing where it says none.
  [[nodiscard]] std::optional<bool> mileage_falls(size_t track) const {
    const auto found = mileage_falls_.find(track);
    return found == mileage_falls_.end() ? std::nullopt : std::optional(found->second);
  }
  /// Does the file say where the element lies?
  [[nodiscard]] static bool has_location(const pugi::xml_node& node);
  /// Where an element lies; what lies on coarser net elements only is left out.
  [[nodiscard]] std::vector<NetPlace> of(const pugi::xml_node& node);
  void tell_missing(const pugi::xml_node& of, const std::string& kind, const std::string& id,
                    const std::string& therefore);

 private:
  [[nodiscard]] std::optional<size_t> find_track(const pugi::xml_node& of, const pugi::xml_node& location);
  /// Altogether, and told.
  [[nodiscard]] bool is_beyond(const pugi::xml_node& of, double from_m, double to_m, double length_m);
  void tell_beyond(const pugi::xml_node& of, double at_m, double length_m, const std::string& therefore);
  [[nodiscard]] double within(const pugi::xml_node& of, double at_m, double length_m);

  const XmlSource& source_;
  RailNet& net_;
  std::map<std::string, size_t> track_of_;  // net elements
  std::set<std::string> coarse_;
  std::map<size_t, bool> mileage_falls_;  // of tracks
};

}  // namespace railfix::track
