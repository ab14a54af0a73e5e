// How many position reports were wrong: the group, the directions and the interval of each against the truth on a map.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "evaluation/run_tables.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"
#include "track/map.hpp"

namespace railfix::evaluation {

/// Where reports are judged.
struct ReportGround {
  std::shared_ptr<const track::Map> map;  // of the dataset; its groups are where they really lie
  double foot_to_front_m = 0;             // from the camera's foot, which the truth tells, to the front end
};

struct ReportResult {
  size_t reports = 0;
  size_t with_position = 0;
  Summary doubt_m;  // over + under
  size_t judged = 0;
  size_t wrong = 0;                          // of them, in any of these ways
  size_t wrong_group = 0;                    // on a track that the train did not run, or farther away than was said
  size_t wrong_direction = 0;                // Q_DIRLRBG, or Q_DIRTRAIN of a train that runs
  size_t wrong_interval = 0;                 // does not hold the front end
  std::map<std::string, size_t> not_judged;  // of those with a position, by what is not known of them
};
ReportResult judge_reports(const Truth& truth, const std::vector<ReportRow>& rows, const ReportGround& ground);

}  // namespace railfix::evaluation
