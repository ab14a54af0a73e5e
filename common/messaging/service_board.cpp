#include "messaging/service_board.hpp"

#include "core/time.hpp"

namespace railfix::messaging {
namespace {

constexpr int64_t kPlayerNs = 5 * core::kNsPerSecond;

// While a service is swapped two of its processes speak: the first one counts until it has ended.
bool is_beside(const ServiceSeen& seen, const msg::ServiceStatus& status, int64_t now_ns, uint64_t writer) {
  const int64_t ago_ns = now_ns - seen.received_ns;
  const bool another = status.pid() != seen.status.pid() || writer != seen.writer;
  return seen.received_ns != 0 && another && !seen.stopped() && ago_ns >= 0 && ago_ns < ServiceBoard::kSilentNs;
}

}  // namespace

void ServiceBoard::note(const msg::ServiceStatus& status, int64_t now_ns, uint64_t writer) {
  ServiceSeen& seen = services_[key_of(status)];
  if (is_beside(seen, status, now_ns, writer)) return;
  const bool same = seen.received_ns != 0 && seen.alive && seen.status.state() == status.state() &&
                    std::string(seen.status.reason().c_str()) == status.reason().c_str();
  if (!same) seen.since_ns = now_ns;
  seen.status = status;
  seen.writer = writer;
  seen.received_ns = now_ns;
  seen.alive = true;
}

bool ServiceBoard::note_silence(int64_t now_ns) {
  looked_ns_ = now_ns;
  const int64_t passed_ns = now_ns - std::exchange(came_by_ns_, now_ns);
  const bool in_time = passed_ns >= 0 && passed_ns < kSilentNs - kLookNs;
  const bool played = player_ns_ != 0 && now_ns - player_ns_ < kPlayerNs;
  if (!in_time || played) return false;
  bool fallen = false;
  for (auto& [key, seen] : services_) {
    if (!seen.alive || now_ns - seen.received_ns < kSilentNs) continue;
    seen.alive = false;
    fallen = true;
    if (!seen.stopped()) seen.since_ns = seen.received_ns;
  }
  return fallen;
}

bool ServiceBoard::note_silence_now_and_then(int64_t now_ns) {
  const bool lately = now_ns >= looked_ns_ && now_ns - looked_ns_ < kLookNs;
  if (!lately) return note_silence(now_ns);
  came_by_ns_ = now_ns;
  return false;
}

void ServiceBoard::forget_stopped(int64_t before_ns, const std::function<bool(const Key&)>& keep) {
  std::erase_if(services_, [&](const auto& entry) {
    return entry.second.stopped() && entry.second.received_ns < before_ns && !keep(entry.first);
  });
}

const ServiceSeen* ServiceBoard::find(const std::string& service) const {
  const ServiceSeen* best = nullptr;
  for (const auto& [key, seen] : services_) {
    if (key.second == service && (best == nullptr || (seen.alive && !best->alive))) best = &seen;
  }
  return best;
}

}  // namespace railfix::messaging
