#include "compare/one_train.hpp"

#include <algorithm>
#include <iterator>
#include <set>

namespace railfix::compare {
namespace {

std::set<uint32_t> engines_of(const std::vector<TimedReport>& reports) {
  std::set<uint32_t> engines;
  for (const auto& report : reports) engines.insert(report.fields.nid_engine);
  return engines;
}

std::string told(const std::set<uint32_t>& engines) {
  constexpr size_t kMostTold = 5;
  std::string text;
  size_t count = 0;
  for (const uint32_t engine : engines) {
    if (++count > kMostTold) return text + " and " + std::to_string(engines.size() - kMostTold) + " more";
    text += (count > 1 ? ", " : "") + std::to_string(engine);
  }
  return text;
}

}  // namespace

core::Result<OneTrain> of_one_train(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified) {
  const auto own = engines_of(ours);
  const auto theirs = engines_of(certified);
  if (own.empty() || theirs.empty()) return OneTrain{certified, ""};
  if (own.size() > 1)
    return core::Error{"ours are reports of several trains, NID_ENGINE " + told(own) + "; give those of one"};
  const uint32_t engine = *own.begin();
  if (theirs.size() == 1) {
    if (theirs.contains(engine)) return OneTrain{certified, ""};
    return OneTrain{certified, "NID_ENGINE is " + told(own) + " in ours and " + told(theirs) +
                                   " in the certified reports: are they of the same train?"};
  }
  if (!theirs.contains(engine)) {
    return core::Error{"the certified reports are of several trains, NID_ENGINE " + told(theirs) +
                       ", and ours of none of them, NID_ENGINE " + told(own) + "; give those of the same train"};
  }
  OneTrain one;
  std::ranges::copy_if(certified, std::back_inserter(one.certified),
                       [&](const TimedReport& report) { return report.fields.nid_engine == engine; });
  one.remark = std::to_string(certified.size() - one.certified.size()) + " certified reports are of other trains (" +
               std::to_string(theirs.size() - 1) + " beside NID_ENGINE " + told(own) + "), left out";
  return one;
}

}  // namespace railfix::compare
