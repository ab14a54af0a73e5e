// Cant of an ERJU map's track edges.
#pragma once

#include <set>

#include "track/import/xml/erju_azimuths.hpp"

namespace railfix::track {

/// Cant points of the plan; on an edge without any, the sampled cants. Millimetres, as all lengths of the files. The
/// schema does not say which rail is higher where a value is positive: the curves do, whose outer rail it is.
class ErjuCants {
 public:
  ErjuCants(const XmlSource& infra, const ErjuEdges& edges, RailNet& net);
  /// The azimuths of an edge, which show its curves.
  void add_curves(size_t track, std::vector<ErjuAzimuth> azimuths) { azimuths_[track] = std::move(azimuths); }
  /// Sets the cant of all tracks, and says in `net.problems` what is not sure of it.
  void settle();

 private:
  struct Votes {
    size_t as_map = 0;  // values whose sign is the curve's, left positive
    size_t turned = 0;
    bool any = false;
    bool below_0 = false;
  };
  enum class Sign { as_map, turned, amount };

  void read_points(const pugi::xml_node& geometry);
  void read_samples(const pugi::xml_node& sampled);
  [[nodiscard]] double bend(size_t track, double offset_m) const;
  [[nodiscard]] Votes votes() const;
  [[nodiscard]] Sign sign_of(const Votes& votes) const;
  void take_as_amounts(NetTrack& on, size_t track);

  const XmlSource& infra_;
  const ErjuEdges& edges_;
  RailNet& net_;
  std::map<size_t, std::vector<ErjuAzimuth>> azimuths_;  // tracks
  std::set<size_t> sampled_;                             // tracks
};

}  // namespace railfix::track
