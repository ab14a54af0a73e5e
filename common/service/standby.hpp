// Private to this folder: Charge on the air.
#pragma once

#include <functional>
#include <string>

#include "messaging/charge_topic.hpp"
#include "service/charge.hpp"
#include "service/service.hpp"

namespace railfix::service {

class Standby {
 public:
  static constexpr std::chrono::milliseconds kPeriod{25};

  /// `beside`: another one of this service runs on this host.
  Standby(messaging::Participant& participant, messaging::Queue& queue, std::string service, const CommonConfig& common,
          bool beside, ChargeHandlers handlers);
  /// Once a period.
  void update();
  [[nodiscard]] bool in_charge() const;
  [[nodiscard]] std::string holder() const { return charge_.holder(); }
  /// The others need not wait: the last thing to call.
  void leave();

 private:
  void say(bool leaving);
  [[nodiscard]] bool has_company() const { return expects_peers_ || !charge_.alone(); }

  messaging::Participant& participant_;
  std::string service_;
  std::string host_;
  bool expects_peers_;
  bool found_somebody_ = false;  // of the train
  ChargeHandlers handlers_;
  Charge charge_;
  messaging::Writer<msg::InCharge> writer_;
  messaging::Reader<msg::InCharge> reader_;
};

}  // namespace railfix::service
