// What railML 2 tells once per track and reaches over its end: tunnels and platforms.
#pragma once

#include <map>
#include <vector>

#include "track/import/xml/net_places.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Of every track, the pieces that switches cut it into, by the offset of their begin.
using Railml2Pieces = std::map<size_t, std::map<double, size_t>>;

class Railml2Stretches {
 public:
  /// On the track as it is before it is cut. An end that is not on it is left out, and told.
  void add(NetPlace place, const pugi::xml_node& of, RailNet& net);

  /// Once the tracks are cut and linked. What touches over a link is one, whatever the tracks call it.
  void add_portals(const Railml2Pieces& pieces, RailNet& net) const;
  void add_ends(const Railml2Pieces& pieces, RailNet& net) const;

 private:
  struct Stretch {
    NetPlace place;
    bool has_begin = true;
    bool has_end = true;
    pugi::xml_node of;
  };
  struct Parts {
    std::vector<NetPlace> places;
    std::vector<const Stretch*> of;
    /// The stretch whose begin or end this is; nullptr where that is left out.
    [[nodiscard]] const Stretch* told_by(const NetSpot& spot) const;
  };
  [[nodiscard]] Parts parts(const Railml2Pieces& pieces, const RailNet& net) const;

  std::vector<Stretch> stretches_;
};

}  // namespace railfix::track
