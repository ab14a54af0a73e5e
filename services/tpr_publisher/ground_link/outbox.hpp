// Which report goes to the broker next: in order, a few under way at a time, each until the broker has confirmed it.
// What could not be stored is newer than everything stored, and goes behind it.
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
  /// All that is stored is under way, and one more may be.
  [[nodiscard]] bool takes_unstored() const { return may_publish() && waiting_.empty(); }
  void published_unstored(int id) { under_way_[id] = std::nullopt; }
  /// next() was given to the client under this id.
  void published(int id);
  /// next() cannot be read from the store.
  void skip() { waiting_.pop_front(); }
  /// The stored report that the broker has confirmed; nothing for an unknown id, or when it is not stored.
  std::optional<uint64_t> delivered(int id);
  /// Drops the oldest that are not under way until no more than `limit` wait; gives what was dropped.
  std::vector<uint64_t> limit(size_t limit);

  [[nodiscard]] size_t size() const { return waiting_.size() + under_way_.size(); }

 private:
  [[nodiscard]] bool may_publish() const { return connected_ && !repeating_ && under_way_.size() < most_under_way_; }
  size_t most_under_way_;
  bool connected_ = false;
  bool repeating_ = false;
  std::deque<uint64_t> waiting_;
  std::map<int, std::optional<uint64_t>> under_way_;  // by the client's id; nothing = not stored
};

}  // namespace railfix::tpr_publisher
