#include "monitor/service_board.hpp"

namespace railfix::monitor {

void ServiceBoard::note(const msg::ServiceStatus& status, int64_t now_ns) {
  ServiceSeen& seen = services_[key_of(status)];
  const bool same = seen.received_ns != 0 && seen.alive && seen.status.state() == status.state() &&
                    std::string(seen.status.reason().c_str()) == status.reason().c_str();
  if (!same) seen.since_ns = now_ns;
  seen.status = status;
  seen.received_ns = now_ns;
  seen.alive = true;
}

bool ServiceBoard::note_silence(int64_t now_ns) {
  bool fallen = false;
  for (auto& [key, seen] : services_) {
    if (!seen.alive || now_ns - seen.received_ns < kSilentNs) continue;
    seen.alive = false;
    fallen = true;
    if (!seen.stopped()) seen.since_ns = seen.received_ns;
  }
  return fallen;
}

const ServiceSeen* ServiceBoard::find(const std::string& service) const {
  const ServiceSeen* best = nullptr;
  for (const auto& [key, seen] : services_) {
    if (key.second == service && (best == nullptr || (seen.alive && !best->alive))) best = &seen;
  }
  return best;
}

}  // namespace railfix::monitor
