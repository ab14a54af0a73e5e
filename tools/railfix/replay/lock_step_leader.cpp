#include "replay/lock_step_leader.hpp"

#include <algorithm>

#include "core/similar_names.hpp"
#include "core/time.hpp"
#include "service/service.hpp"

namespace railfix::tool {

namespace {

std::vector<std::string> in_order(const std::vector<std::string>& services) {
  std::vector<std::string> ordered;
  for (const auto& name : service::service_names())
    if (std::ranges::find(services, name) != services.end()) ordered.push_back(name);
  for (const auto& name : services) {
    if (std::ranges::find(ordered, name) == ordered.end()) {
      throw core::BadInput("--lock-step " + name + " is no service; " +
                           core::did_you_mean(name, service::service_names()));
    }
  }
  return ordered;
}

}  // namespace

LockStepLeader::LockStepLeader(messaging::Participant& participant, messaging::Queue& queue,
                               const std::vector<std::string>& services)
    : participant_(participant),
      services_(in_order(services)),
      lock_step_(services_),
      clock_(participant, messaging::topics::data_clock),
      progress_(participant, messaging::topics::data_progress, "", queue,
                [this](const msg::DataProgress& progress) { answered(progress); }) {}

void LockStepLeader::begin(int64_t data_ns) {
  data_ns_ = data_ns;
  sent_.note(messaging::sent_samples(participant_));
  lock_step_.begin();
  give_turn();
}

void LockStepLeader::give_turn() {
  if (!lock_step_.done()) publish(false);
}

void LockStepLeader::answered(const msg::DataProgress& progress) {
  if (!lock_step_.answered(progress.service().c_str(), progress.seq())) return;
  sent_.note(progress.sent());
  give_turn();
}

void LockStepLeader::publish(bool ended) {
  msg::DataClock clock;
  clock.data_ns(data_ns_);
  clock.wall_ns(core::wall_ns());
  clock.seq(lock_step_.step());
  clock.lock_step(1);
  clock.ended(ended ? 1 : 0);
  if (!ended) {
    clock.turn(lock_step_.turn());
    sent_.say(clock);
  }
  clock_.write(clock);
}

void LockStepLeader::end() {
  publish(true);
}

}  // namespace railfix::tool
