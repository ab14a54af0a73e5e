// Of several services of one kind on a train one is in charge: it alone sends. This is the rule by which they agree,
// each for itself, from what they hear of each other forty times a second. Knows no DDS and no clock.
//
// - The only one of its kind is in charge from the beginning. One that is started beside it, or that may have a peer on
//   another host, listens first.
// - Who is in charge stays so: one that comes back stands by, however strong it is.
// - Who hears of nobody in charge for `silence` takes charge; the best first, the others give it one more `silence`.
// - Silence is counted in turns of one's own: a turn that comes late counts as one of kTurnNs. Who is held up itself,
//   on a host with too much to do, cannot tell whether the other one was silent.
// - Who was held up for so long that somebody else may have taken charge (SIGSTOP, an overloaded host) stands by. One
//   of two by its configuration (it has a strength) always, another one when it has heard a peer within kRememberedNs
//   that has not left in order.
// - Two in charge (a cable is plugged in again): the worse one stands by at once.
// - A standby whose output has been better for kBetterNs gets the charge; for kWorthlessNs when that of the one in
//   charge is worth nothing (fitness 0): time enough for the other one to say the same of its own.
// Fitness counts once it has stood for kSettledNs, and no more as soon as it falls.
// Better: more fitness, then more strength, then the smaller instance; so any two agree on it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace railfix::service {

/// What each of them says of itself.
struct ChargeBeat {
  uint64_t instance = 0;
  int64_t strength = 0;
  int fitness = 0;
  bool in_charge = false;
  bool leaving = false;
  std::string host;
};

class Charge {
 public:
  /// The first one that starts listens for so long before it takes charge: others have to find it first. It counts
  /// from the moment when anybody of the train was found; nobody is waited for longer than kLonelyNs.
  static constexpr int64_t kNewcomerNs = 1'000'000'000;
  static constexpr int64_t kLonelyNs = 5'000'000'000;
  static constexpr int64_t kTurnNs = 50'000'000;
  static constexpr int64_t kSettledNs = 2'000'000'000;
  static constexpr int64_t kBetterNs = 5'000'000'000;
  static constexpr int64_t kWorthlessNs = 150'000'000;
  static constexpr int64_t kRememberedNs = 5'000'000'000;
  /// After so long, a little less than a participant's lease, DDS may have forgotten the others: they must be found
  /// again.
  static constexpr int64_t kAwayNs = 3'000'000'000;
  static constexpr int64_t kFoundAgainNs = 2'000'000'000;

  Charge(uint64_t instance, int64_t strength, int64_t silence_ns, bool listens_first = true);

  /// Times are of the monotonic clock.
  void hear(const ChargeBeat& beat, int64_t now_ns);
  /// Nobody of the train has been found yet: to be called before update() as long as that is so.
  void found_nobody(int64_t now_ns);
  /// To be called many times within `silence`. True when the charge was taken by this call.
  bool update(int fitness, int64_t now_ns);
  /// May it send at this moment? False also when update() is overdue by so much that somebody else may have begun.
  [[nodiscard]] bool in_charge(int64_t now_ns) const { return in_charge_ && !held_up(now_ns); }
  /// What to tell the others.
  [[nodiscard]] ChargeBeat beat() const;
  [[nodiscard]] bool alone() const { return peers_.empty(); }
  /// Host of another one in charge; empty when nobody else is known to be.
  [[nodiscard]] std::string holder() const;

 private:
  struct Peer {
    ChargeBeat beat;
    int64_t heard_ns = 0;                    // in own turns, as all that follows
    std::optional<int64_t> better_since_ns;  // in fitness than this one
  };
  [[nodiscard]] bool held_up(int64_t now_ns) const;
  /// Time in own turns.
  [[nodiscard]] int64_t turns_ns(int64_t now_ns) const;
  [[nodiscard]] static bool better(const ChargeBeat& a, const ChargeBeat& b);
  void settle(int fitness, int64_t now_ns);
  [[nodiscard]] bool must_stand_by(int64_t now_ns) const;
  [[nodiscard]] bool may_take(int64_t now_ns) const;
  void stand_by(int64_t now_ns);
  void look_at_peers(int64_t now_ns);

  uint64_t instance_;
  int64_t strength_;
  int64_t silence_ns_;
  int fitness_ = 0;            // that counts
  bool worthless_ = false;     // as last told, whatever counts yet
  std::optional<int> more_;    // least fitness of those above it ...
  int64_t more_since_ns_ = 0;  // ... since then
  bool in_charge_ = false;
  bool begun_ = false;
  int64_t updated_ns_ = 0;  // of the monotonic clock ...
  int64_t turned_ns_ = 0;   // ... and in own turns
  int64_t begun_ns_ = 0;
  int64_t listens_until_ns_ = 0;          // does not take charge before
  int64_t holder_heard_ns_ = 0;           // the last word of one in charge
  std::optional<int64_t> peer_heard_ns_;  // of anybody who has not left in order
  std::map<uint64_t, Peer> peers_;
};

}  // namespace railfix::service
