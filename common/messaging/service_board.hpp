// Every service of the train as it says of itself and as it is heard: state, since when, alive or not.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "idl/operation.h"

namespace railfix::messaging {

struct ServiceSeen {
  msg::ServiceStatus status;
  uint64_t writer = 0;  // SampleInfo::writer of the status
  int64_t received_ns = 0;
  int64_t since_ns = 0;  // in this state, for this reason, alive or not
  bool alive = true;     // has said something lately
  [[nodiscard]] bool stopped() const { return status.state() == msg::STATE_STOPPED; }
  /// It shows signs of life and has not been stopped.
  [[nodiscard]] bool runs() const { return alive && !stopped(); }
  [[nodiscard]] std::string name() const { return status.service().c_str(); }
};

class ServiceBoard {
 public:
  static constexpr int64_t kSilentNs = 700'000'000;
  /// How often note_silence wants to be called.
  static constexpr int64_t kLookNs = 250'000'000;
  /// Its host and name tell one service from another.
  using Key = std::pair<std::string, std::string>;

  /// `writer` tells two processes of a service from each other when their numbers do not: those of containers are
  /// equal.
  void note(const msg::ServiceStatus& status, int64_t now_ns, uint64_t writer = 0);
  /// A player was heard: it sends statuses as they were recorded, at its own rate, so for 5 s nobody is called silent.
  void note_player(int64_t now_ns) { player_ns_ = now_ns; }
  /// Who has said nothing for kSilentNs is dead, frozen or stopped: services speak four times a second. Nobody is
  /// silent because the caller was held up itself, or because the clock was set. True: somebody is silent since the
  /// last time.
  bool note_silence(int64_t now_ns);
  /// The same for who comes by all the time: looks no more often than kLookNs.
  bool note_silence_now_and_then(int64_t now_ns);
  /// Who stopped in good order before this time, unless it is to be kept.
  void forget_stopped(int64_t before_ns, const std::function<bool(const Key&)>& keep);
  [[nodiscard]] const std::map<Key, ServiceSeen>& services() const { return services_; }
  /// On whichever host; nullptr = never seen.
  [[nodiscard]] const ServiceSeen* find(const std::string& service) const;

 private:
  static Key key_of(const msg::ServiceStatus& status) { return {status.host().c_str(), status.service().c_str()}; }
  std::map<Key, ServiceSeen> services_;
  int64_t player_ns_ = 0;
  int64_t looked_ns_ = 0;   // for silence
  int64_t came_by_ns_ = 0;  // the caller, to look or not
};

}  // namespace railfix::messaging
