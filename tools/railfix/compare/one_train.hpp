// Which of the reports are of the same train: a radio block centre's log holds those of all.
#pragma once

#include <string>
#include <vector>

#include "compare/report_file.hpp"

namespace railfix::compare {

struct OneTrain {
  std::vector<TimedReport> certified;
  std::string remark;  // one sentence; empty where NID_ENGINE is the same in all
};

/// The certified reports with NID_ENGINE of ours; all, where they are of one train with another number. An error names
/// the numbers where ours are of several trains, or the certified ones are and ours is none of them.
core::Result<OneTrain> of_one_train(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified);

}  // namespace railfix::compare
