#include "service/state_log.hpp"

#include <cctype>

#include "core/time.hpp"
#include "idl/operation.h"

namespace railfix::service {
namespace {

constexpr int64_t kQuietNs = 10 * core::kNsPerSecond;

/// Troubles that differ only in how much or how long are one.
std::string without_numbers(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) out += c;
  }
  return out;
}

}  // namespace

std::optional<StateLog::Line> StateLog::follow(uint8_t state, const std::string& reason, int64_t monotonic_ns) {
  if (state == msg::STATE_STOPPED) return std::nullopt;
  const bool trouble = state == msg::STATE_DEGRADED || state == msg::STATE_FAILED;
  const std::string text = (state == msg::STATE_FAILED ? "failed: " : "degraded: ") + reason;
  std::string now = trouble ? without_numbers(text) : "";
  if (now != now_) ++changes_;
  now_ = std::move(now);
  if (now_ == said_ || (said_ns_ && monotonic_ns - *said_ns_ < kQuietNs)) return std::nullopt;
  std::string of_many;
  if (changes_ > 1)
    of_many = " (" + std::to_string(changes_) + " changes in " +
              std::to_string((monotonic_ns - *said_ns_) / core::kNsPerSecond) + " s)";
  said_ = now_;
  said_ns_ = monotonic_ns;
  changes_ = 0;
  return Line{trouble, (trouble ? text : "well again") + of_many};
}

}  // namespace railfix::service
