#include "core/similar_names.hpp"

#include <algorithm>
#include <numeric>

#include "core/joined.hpp"

namespace railfix::core {
namespace {

/// Edit distance: how many letters must be put in, taken out or changed (Wagner and Fischer 1974).
size_t distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::vector<std::string> similar_names(const std::string& wanted, const std::vector<std::string>& names) {
  constexpr size_t kMost = 5;
  constexpr size_t kPart = 4;  // letters: shorter names are part of too many others
  const auto is_part = [](const std::string& part, const std::string& whole) {
    return part.size() >= kPart && whole.find(part) != std::string::npos;
  };
  const size_t may_change = std::min(std::max<size_t>(2, wanted.size() / 3), wanted.size() / 2);
  std::vector<std::pair<size_t, std::string>> ranked;
  for (const auto& name : names) {
    const size_t changes = is_part(wanted, name) || is_part(name, wanted) ? 1 : distance(wanted, name);
    if (changes <= may_change) ranked.emplace_back(changes, name);
  }
  std::ranges::sort(ranked);
  std::vector<std::string> similar;
  for (const auto& [changes, name] : ranked) {
    if (similar.size() < kMost) similar.push_back(name);
  }
  return similar;
}

std::string did_you_mean(const std::string& wanted, const std::vector<std::string>& names) {
  const auto similar = similar_names(wanted, names);
  return similar.empty() ? "there are: " + joined(names) : "did you mean " + joined(similar) + "?";
}

}  // namespace railfix::core
