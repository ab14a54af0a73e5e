#include "service/charge.hpp"

#include <algorithm>
#include <tuple>

namespace railfix::service {

Charge::Charge(uint64_t instance, int64_t strength, int64_t silence_ns, bool listens_first)
    : instance_(instance), strength_(strength), silence_ns_(silence_ns), in_charge_(!listens_first) {}

bool Charge::better(const ChargeBeat& a, const ChargeBeat& b) {
  return std::tuple(a.fitness, a.strength, b.instance) > std::tuple(b.fitness, b.strength, a.instance);
}

ChargeBeat Charge::beat() const {
  return {instance_, strength_, fitness_, in_charge_, false, ""};
}

std::string Charge::holder() const {
  for (const auto& [instance, peer] : peers_) {
    if (peer.beat.in_charge) return peer.beat.host;
  }
  return "";
}

void Charge::hear(const ChargeBeat& beat, int64_t now_ns) {
  if (beat.instance == instance_) return;
  if (beat.leaving) {
    peers_.erase(beat.instance);
    if (peers_.empty()) peer_heard_ns_.reset();
    return;
  }
  Peer& peer = peers_[beat.instance];
  peer.beat = beat;
  peer.heard_ns = turns_ns(now_ns);
  peer_heard_ns_ = peer.heard_ns;
  if (beat.in_charge) holder_heard_ns_ = peer.heard_ns;
}

int64_t Charge::turns_ns(int64_t now_ns) const {
  return turned_ns_ + std::min(now_ns - updated_ns_, kTurnNs);
}

void Charge::found_nobody(int64_t now_ns) {
  if (!begun_ || in_charge_ || turns_ns(now_ns) - begun_ns_ > kLonelyNs) return;
  listens_until_ns_ = std::max(listens_until_ns_, turns_ns(now_ns) + kNewcomerNs);
}

// With nobody to take over, being held up does no harm. One who was silent for a moment, or whom DDS has not announced
// yet, may have gone on meanwhile.
bool Charge::held_up(int64_t now_ns) const {
  const bool one_of_two = strength_ > 0;
  const bool has_peer = one_of_two || (peer_heard_ns_ && turned_ns_ - *peer_heard_ns_ < kRememberedNs);
  return has_peer && now_ns - updated_ns_ > silence_ns_ - silence_ns_ / 5;
}

void Charge::look_at_peers(int64_t now_ns) {
  std::erase_if(peers_, [&](const auto& peer) { return now_ns - peer.second.heard_ns > silence_ns_; });
  for (auto& [instance, peer] : peers_) {
    if (peer.beat.fitness <= fitness_) {
      peer.better_since_ns.reset();
    } else if (!peer.better_since_ns) {
      peer.better_since_ns = now_ns;
    }
  }
}

// One that has just come back, or has just got its cable again, may be as sure as it likes.
void Charge::settle(int fitness, int64_t now_ns) {
  if (fitness <= fitness_) {
    fitness_ = fitness;
    more_.reset();
    return;
  }
  if (!more_) more_since_ns_ = now_ns;
  more_ = std::min(more_.value_or(fitness), fitness);
  if (now_ns - more_since_ns_ < kSettledNs) return;
  fitness_ = *more_;
  more_.reset();
}

bool Charge::must_stand_by(int64_t now_ns) const {
  return std::any_of(peers_.begin(), peers_.end(), [&](const auto& entry) {
    const Peer& peer = entry.second;
    if (peer.beat.in_charge) return better(peer.beat, beat());
    return peer.better_since_ns && now_ns - *peer.better_since_ns >= (worthless_ ? kWorthlessNs : kBetterNs);
  });
}

bool Charge::may_take(int64_t now_ns) const {
  if (now_ns < listens_until_ns_) return false;
  if (std::any_of(peers_.begin(), peers_.end(), [](const auto& peer) { return peer.second.beat.in_charge; }))
    return false;
  const bool best =
      std::none_of(peers_.begin(), peers_.end(), [&](const auto& peer) { return better(peer.second.beat, beat()); });
  return best || now_ns - std::max(holder_heard_ns_, listens_until_ns_) > 2 * silence_ns_;
}

void Charge::stand_by(int64_t now_ns) {
  in_charge_ = false;
  listens_until_ns_ = std::max(listens_until_ns_, now_ns + silence_ns_);
}

bool Charge::update(int fitness, int64_t now_ns) {
  const bool was_held_up = begun_ && held_up(now_ns);
  const bool was_away = was_held_up && now_ns - updated_ns_ > kAwayNs;
  turned_ns_ = turns_ns(now_ns);
  updated_ns_ = now_ns;
  if (!begun_) {
    begun_ = true;
    begun_ns_ = turned_ns_;
    if (!in_charge_) listens_until_ns_ = turned_ns_ + kNewcomerNs;
  } else if (was_held_up) {
    stand_by(turned_ns_);
    if (was_away) listens_until_ns_ = turned_ns_ + kFoundAgainNs;
  }
  worthless_ = fitness == 0;
  settle(fitness, turned_ns_);
  look_at_peers(turned_ns_);
  if (in_charge_) {
    if (must_stand_by(turned_ns_)) stand_by(turned_ns_);
    return false;
  }
  in_charge_ = may_take(turned_ns_);
  return in_charge_;
}

}  // namespace railfix::service
