// The track edges of an ERJU map by their id, and how its readers tell what they leave out.
#pragma once

#include <map>
#include <string>

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// All lengths of the files are millimetres.
constexpr double metres(double millimetres) {
  return 1e-3 * millimetres;
}

class ErjuEdges {
 public:
  /// Makes every <trackEdge> a track of the net. Throws core::BadInput where one is there twice or has no length.
  ErjuEdges(const XmlSource& infra, RailNet& net);
  /// The track that the attribute names. Throws core::BadInput where there is none.
  [[nodiscard]] size_t track_of(const XmlSource& source, const pugi::xml_node& node, const char* attribute) const;

 private:
  std::map<std::string, size_t> index_;
};

/// To half a metre.
inline bool is_on(const NetTrack& edge, double offset_m) {
  constexpr double kRoundedM = 0.5;
  return offset_m > -kRoundedM && offset_m < edge.length_m + kRoundedM;
}

/// Values that are none; told in one sentence on each track edge: where one is in the wrong unit, they all are.
class ErjuLeftOut {
 public:
  void add(const std::string& value, double at_m);
  void tell(const std::string& why, const NetTrack& track, std::vector<std::string>& problems) const;

 private:
  size_t count_ = 0;
  std::string first_;  // "VALUE at 12.00 m"
};

}  // namespace railfix::track
