// Q_LENGTH (Q_INTEGRITY) and L_TRAININT: the way from the estimated front end now to the min safe rear end at the time
// when the train was last known to be complete (SUBSET-026 7.5.1, L_TRAININT).
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "etcs/train_position_report.hpp"

namespace railfix::tpr_publisher {

/// Q_LENGTH (Q_INTEGRITY) that says of the train that it is complete.
constexpr bool is_confirmed(uint32_t q_integrity) {
  return q_integrity == etcs::kConfirmedByDevice || q_integrity == etcs::kConfirmedByDriver;
}

class TrainIntegrity {
 public:
  struct Place {
    int64_t stamp_ns = 0;
    double distance_m = 0;  // travelled, signed
    double over_m = 0;      // L_DOUBTOVER's amount at that time
    bool known = true;      // on the map; no rear end can be told from one that is not
    double moved_m = 0;     // so much further on than the way from the last place says; infinite = nobody knows
  };
  struct Said {
    uint32_t q_length = 0;               // 0 = no information
    std::optional<uint32_t> l_trainint;  // m, with q_length 1 or 2
  };

  /// REQUIRES: stamps do not go back and the distance goes on, or lose_way() was called.
  void follow(const Place& place);
  /// How far the train has gone since the last place is not known, as when whoever counts the distance began again: the
  /// rear end of the confirmation is not known any more, and only another confirmation gives one.
  void lose_way();
  /// q_integrity as in the message; the train was complete at integrity_ns. Confirmed without a length, at a time that
  /// is longer ago than ten seconds, or before any place is known, it says nothing. Until the place of that time has
  /// come, what was heard before stands; newer ones wait until then. What is no confirmation stands at once. One whose
  /// length is another one later was not of this train (3.6.5.2.7, 4.0.0 table 2c [3]): it says nothing any more.
  void hear(uint32_t q_integrity, int64_t integrity_ns, double train_length_m);
  /// The confirmation that stands says nothing any more. In 4.0.0 it is reported once, and ends when the train backs
  /// (3.6.5.2.5, table 2c [5] and [8]).
  void use_up() { used_up_ns_ = integrity_ns(); }
  /// As use_up(): somebody else has reported it, with a place of that time. It may not have been settled here yet.
  void use_up_until(int64_t stamp_ns);
  /// A train that has backed since then is not taken for shorter. reported_ahead_m: how far in front of distance_m the
  /// report says the front end to be, from which trackside counts the length. A front end that was moved forward since
  /// then leaves the rear end where it was.
  [[nodiscard]] Said said(double distance_m, double reported_ahead_m = 0) const;
  /// What said() speaks of.
  [[nodiscard]] uint32_t q_integrity() const { return stands().q_integrity; }
  [[nodiscard]] int64_t integrity_ns() const { return stands().integrity_ns; }
  /// A confirmation that could be said before the way was lost.
  [[nodiscard]] bool forgotten() const {
    return forgotten_ && is_confirmed(heard_.q_integrity) && heard_.integrity_ns != used_up_ns_;
  }

 private:
  struct Confirmation {
    uint32_t q_integrity = etcs::kNoIntegrityInformation;
    int64_t integrity_ns = 0;
  };
  void settle();
  void place_rear();
  void forget_rear();
  [[nodiscard]] const Confirmation& stands() const { return settled_ ? heard_ : before_; }

  std::deque<Place> places_;  // of the last ten seconds
  Confirmation heard_;
  Confirmation before_;               // stands until heard_ is settled
  std::optional<Confirmation> next_;  // waits until heard_ is settled
  double train_length_m_ = 0;
  std::optional<int64_t> confirmed_ns_;  // with train_length_m_
  std::optional<int64_t> used_up_ns_;    // integrity_ns of a confirmation that says nothing any more
  bool settled_ = true;                  // rear_m_ belongs to heard_
  bool forgotten_ = false;               // it was known before the way was lost
  std::optional<double> rear_m_;         // min safe rear end, on the travelled distance
  Place then_;                           // the place then; moved_m: since then
};

}  // namespace railfix::tpr_publisher
