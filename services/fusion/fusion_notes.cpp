#include "fusion/fusion_notes.hpp"

#include <cmath>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "messaging/messaging.hpp"

namespace railfix::fusion {
namespace {

constexpr const char* kInDoubt = " in doubt";

}  // namespace

// A line for the time behind what they are for, then the state as it is sent.
std::string to_notes(const std::string& kept_for, const KnownState& known) {
  const auto cdr = messaging::serialize(known.state);
  return kept_for + std::to_string(known.noted_ns.value_or(0)) + (known.in_doubt ? kInDoubt : "") + '\n' +
         std::string(cdr.begin(), cdr.end());
}

std::optional<KnownState> from_notes(const std::string& kept_for, const std::string& notes) {
  if (!notes.starts_with(kept_for)) return std::nullopt;
  const size_t line_end = notes.find('\n', kept_for.size());
  if (line_end == std::string::npos) return std::nullopt;
  KnownState known;
  const std::vector<uint8_t> cdr(notes.begin() + static_cast<std::ptrdiff_t>(line_end) + 1, notes.end());
  if (!messaging::deserialize(cdr, known.state) || !std::isfinite(known.state.distance_m())) return std::nullopt;
  known.noted_ns = std::atoll(notes.c_str() + kept_for.size());
  known.in_doubt = std::string_view(notes).substr(0, line_end).ends_with(kInDoubt);
  return known;
}

}  // namespace railfix::fusion
