// Private to the checks: how they tell what they find.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "train/check.hpp"

namespace railfix::tool {

using Findings = std::vector<Finding>;

inline void error(Findings& findings, std::string text) {
  findings.push_back({true, std::move(text)});
}
inline void warning(Findings& findings, std::string text) {
  findings.push_back({false, std::move(text)});
}
/// What several services or hosts share is told once.
inline void add_once(Findings& findings, Finding finding) {
  if (std::ranges::find(findings, finding) == findings.end()) findings.push_back(std::move(finding));
}

}  // namespace railfix::tool
