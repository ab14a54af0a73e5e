#include "track/import/xml/erju_unread.hpp"

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

void tell(const XmlSource& infra, const char* geometry, const char* item, const std::string& what,
          std::vector<std::string>& problems) {
  size_t count = 0;
  std::string first;
  for (const pugi::xml_node& of : descendants(infra.root(), geometry)) {
    if (descendants(of, item).empty()) continue;
    if (count++ == 0) first = of.attribute("id").value();
  }
  if (count == 0) return;
  problems.push_back("track edge \"" + first + "\"" + told_as_more(count) + " has " + what);
}

}  // namespace

void tell_unread(const XmlSource& infra, std::vector<std::string>& problems) {
  tell(infra, "trackEdgeGeometry", "verticalAlignmentItem",
       "gradients in its vertical alignment, whose units no schema at hand gives; they are left out, only sampled "
       "slopes are read",
       problems);
  tell(infra, "sampledTrackEdgeGeometry", "curve",
       "sampled curve radii, whose unit and sign no schema at hand gives; they are left out, curves come from "
       "coordinates or azimuths",
       problems);
}

}  // namespace railfix::track
