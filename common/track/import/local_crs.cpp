#include "track/import/local_crs.hpp"

#include <iomanip>
#include <sstream>

namespace railfix::track {

std::string local_crs(const GeoPoint& middle) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(4) << "+proj=tmerc +lat_0=" << middle.lat_deg << " +lon_0=" << middle.lon_deg
       << " +k=1 +x_0=100000 +y_0=100000 +ellps=WGS84 +units=m +no_defs +type=crs";
  return text.str();
}

}  // namespace railfix::track
