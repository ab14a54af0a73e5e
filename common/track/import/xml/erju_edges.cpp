#include "track/import/xml/erju_edges.hpp"

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kLongestEdgeM = 1e6;

}  // namespace

ErjuEdges::ErjuEdges(const XmlSource& infra, RailNet& net) {
  for (const pugi::xml_node& edge : descendants(infra.root(), "trackEdge")) {
    const std::string id = infra.required_text(edge, "id");
    const double length = metres(infra.required(edge, "trackEdgeLength"));
    if (!(length > 0 && length < kLongestEdgeM))
      throw infra.wrong(edge, "track edge \"" + id + "\" must be between 0 and 1000 km long");
    if (!index_.emplace(id, net.tracks.size()).second)
      throw infra.wrong(edge, "track edge \"" + id + "\" is there twice");
    NetTrack& track = net.tracks.emplace_back();
    track.track.name = id;
    track.length_m = length;
  }
  if (net.tracks.empty()) throw core::BadInput(infra.file_name() + " holds no <trackEdge>");
}

size_t ErjuEdges::track_of(const XmlSource& source, const pugi::xml_node& node, const char* attribute) const {
  const std::string id = source.required_text(node, attribute);
  const auto found = index_.find(id);
  if (found == index_.end())
    throw source.wrong(node,
                       "<" + std::string(node.name()) + "> names the track edge \"" + id + "\", which does not exist");
  return found->second;
}

void ErjuLeftOut::add(const std::string& value, double at_m) {
  if (count_++ == 0) first_ = value + " at " + told_m(at_m);
}

void ErjuLeftOut::tell(const std::string& why, const NetTrack& track, std::vector<std::string>& problems) const {
  if (count_ == 0) return;
  const std::string more = count_ > 1 ? " and " + std::to_string(count_ - 1) + " more like it" : "";
  problems.push_back("track edge \"" + track.track.name + "\" has " + first_ + more + ", " + why);
}

}  // namespace railfix::track
