// Position report parameters as the trackside tells them in packet 58: which packet is used, which one is not (yet),
// and what a later process has to know of them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tpr_publisher/tpr_publisher.hpp"

namespace railfix::tpr_publisher {

class ToldParameters {
 public:
  explicit ToldParameters(TprPublisher& publisher) : publisher_(publisher) {}

  /// notes() of the process before, used as they are; what cannot be read says nothing. True when they are used.
  bool remember(const std::string& notes);
  /// What stands in an onboard_status; empty = none. `just_come`: it did not stand in one of some seconds ago, and its
  /// locations count from the present LRBG. True when it is used from now on.
  bool hear(std::span<const uint8_t> packet, bool just_come);
  /// To be called when the publisher has followed the train: what came before the train's direction was known may fit
  /// now, and the LRBG that locations count from may have been found. True when one is used from now on.
  bool follow();
  /// The publisher is a new one: it gets what the one before had.
  void begin_anew();
  /// Why what was heard last is not used; empty = it is.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }
  /// "HEX LRBG" of what is used, or "HEX" when its locations have no LRBG yet; empty = nothing.
  [[nodiscard]] std::string notes() const;

 private:
  struct Packet {
    std::vector<uint8_t> bytes;
    std::optional<uint32_t> origin;  // LRBG when it came, for its locations; nothing = the next one
  };
  core::Status take_newer();
  bool try_newer();

  TprPublisher& publisher_;
  std::optional<Packet> used_;
  std::optional<Packet> newer_;  // heard since, and refused ...
  bool waits_ = false;           // ... but for the train's direction, which is not known
  std::string refusal_;
};

}  // namespace railfix::tpr_publisher
