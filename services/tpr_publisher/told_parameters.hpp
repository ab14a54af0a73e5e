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
  /// What stands in an onboard_status; empty = none. `lrbg`: the group that the message which brought it refers to
  /// (3.6.2.2.1); where that was not said (0, "unknown"), the present LRBG of a packet that has `just_come`: it did not
  /// stand in an onboard_status of some seconds ago. `count`: of those that have come; the same one once more is a new
  /// one where it is higher than before. True when it is used from now on.
  bool hear(std::span<const uint8_t> packet, bool just_come, uint32_t lrbg = etcs::kUnknownBaliseGroup,
            uint32_t count = 0);
  /// None is valid any more (4.9.1.3, table 4.10): those of the settings again. True when that is new.
  bool hear_deleted();
  /// To be called when the publisher has followed the train: what came before the train's direction was known may fit
  /// now, and the LRBG that locations count from may have been found. True when one is used from now on.
  bool follow();
  /// The publisher is a new one: it gets what the one before had.
  void begin_anew();
  /// Why what was heard last is not used; empty = it is.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }
  /// "HEX LRBG" of what is used, or "HEX" when its locations have no LRBG yet, and " over" behind that when they are
  /// over; empty = nothing.
  [[nodiscard]] std::string notes() const;

 private:
  struct Packet {
    std::vector<uint8_t> bytes;
    std::optional<uint32_t> origin;  // what it refers to; nothing = the next LRBG
    bool over = false;               // its locations are: a later process does not begin with them again
  };
  [[nodiscard]] bool is_known(std::span<const uint8_t> packet, std::optional<uint32_t> lrbg) const;
  core::Status take_newer(bool waited);
  bool try_newer(bool waited);

  TprPublisher& publisher_;
  std::optional<Packet> used_;
  std::optional<Packet> newer_;    // heard since, and refused ...
  std::optional<uint32_t> count_;  // heard last; nothing = not counted
  bool waits_ = false;             // ... but for the train's direction, which is not known
  std::string refusal_;
};

}  // namespace railfix::tpr_publisher
