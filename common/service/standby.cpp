#include "service/standby.hpp"

#include <random>

#include "core/time.hpp"

namespace railfix::service {
namespace {

constexpr int kLastWords = 3;  // beats are best effort

uint64_t random_number() {
  std::random_device device;
  return uint64_t{device()} << 32U | device();
}

ChargeBeat beat_of(const msg::InCharge& said) {
  return {said.instance(),     static_cast<int64_t>(said.strength()),
          said.fitness(),      said.in_charge() != 0,
          said.leaving() != 0, said.host().c_str()};
}

}  // namespace

Standby::Standby(messaging::Participant& participant, messaging::Queue& queue, std::string service,
                 const CommonConfig& common, bool beside, ChargeHandlers handlers)
    : participant_(participant),
      service_(std::move(service)),
      host_(common.host),
      expects_peers_(common.ownership_strength > 0 || beside),
      handlers_(std::move(handlers)),
      charge_(random_number(), common.ownership_strength, core::to_ns(common.take_over_s), expects_peers_),
      writer_(participant, messaging::topics::in_charge),
      reader_(participant, messaging::topics::in_charge, "", queue, [this](const msg::InCharge& said) {
        if (service_ == said.service().c_str()) charge_.hear(beat_of(said), core::monotonic_ns());
      }) {}

void Standby::update() {
  const bool was = charge_.beat().in_charge;
  found_somebody_ = found_somebody_ || participant_.connections().remote_endpoints > 0;
  if (!found_somebody_) charge_.found_nobody(core::monotonic_ns());
  const bool taken = charge_.update(handlers_.fitness(), core::monotonic_ns());
  if (has_company()) say(false);
  if (taken || (was && !charge_.beat().in_charge)) handlers_.changed(taken);
}

bool Standby::in_charge() const {
  return charge_.in_charge(core::monotonic_ns());
}

void Standby::say(bool leaving) {
  const ChargeBeat beat = charge_.beat();
  msg::InCharge said;
  said.instance(beat.instance);
  said.strength(static_cast<uint32_t>(beat.strength));
  said.fitness(static_cast<uint8_t>(beat.fitness));
  said.in_charge(beat.in_charge && !leaving ? 1 : 0);
  said.leaving(leaving ? 1 : 0);
  said.service(service_);
  said.host(host_);
  writer_.write(said);
}

void Standby::leave() {
  if (!has_company()) return;
  for (int i = 0; i < kLastWords; ++i) say(true);
}

}  // namespace railfix::service
