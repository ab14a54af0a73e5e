// Which stored report goes to the broker next: in order, a few under way at a time, each until the broker has confirmed
// it.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

namespace railfix::tpr_publisher {

class Outbox {
 public:
  explicit Outbox(size_t most_under_way) : most_under_way_(most_under_way) {}

  /// A report is in the store. REQUIRES: numbers grow.
  void stored(uint64_t sequence) { waiting_.push_back(sequence); }
  void connected();
  void disconnected() { connected_ = false; }
  /// The report to publish now. After a lost connection the client first repeats what was under way; nothing new goes
  /// out until that is confirmed, because it could overtake.
  [[nodiscard]] std::optional<uint64_t> next() const;
  /// next() was given to the client under this id.
  void published(int id);
  /// next() cannot be read from the store.
  void skip() { waiting_.pop_front(); }
  /// The report the broker has confirmed; nothing for an unknown id.
  std::optional<uint64_t> delivered(int id);
  /// Drops the oldest that are not under way until no more than `limit` wait; gives what was dropped.
  std::vector<uint64_t> limit(size_t limit);

  [[nodiscard]] size_t size() const { return waiting_.size() + under_way_.size(); }

 private:
  size_t most_under_way_;
  bool connected_ = false;
  bool repeating_ = false;
  std::deque<uint64_t> waiting_;
  std::map<int, uint64_t> under_way_;  // by the client's id
};

}  // namespace railfix::tpr_publisher
