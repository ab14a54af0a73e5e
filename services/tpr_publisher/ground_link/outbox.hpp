// Which report goes to the broker next: in order, a few under way at a time, each until the broker has confirmed it.
// On a new connection, and after a report that the broker refused, one goes alone until it is confirmed: of several the
// broker could take a later one first, or end the connection before its refusal of the first is heard.
// What could not be stored goes behind what was stored until then, and before what was stored since.
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
  void stored(uint64_t sequence) {
    waiting_.push_back(sequence);
    newest_ = sequence;
  }
  void connected();
  /// Whether the broker has what was under way is not known: it waits in its place again.
  void disconnected();
  /// The report to publish now.
  [[nodiscard]] std::optional<uint64_t> next() const;
  /// The newest one that is or was in the store, 0 = none yet.
  [[nodiscard]] uint64_t newest() const { return newest_; }
  /// All that is stored up to this number is under way, and one more may be.
  [[nodiscard]] bool takes_unstored(uint64_t behind) const {
    return may_publish() && (waiting_.empty() || waiting_.front() > behind);
  }
  void published_unstored(int id) { under_way_[id] = std::nullopt; }
  /// next() was given to the client under this id.
  void published(int id);
  /// next() cannot be read from the store.
  void skip() { waiting_.pop_front(); }
  /// The stored report that the broker has confirmed; nothing for an unknown id, or when it is not stored.
  std::optional<uint64_t> delivered(int id);
  /// The broker has not taken it: it waits in its place again. Nothing goes out until try_again().
  void refused(int id);
  [[nodiscard]] bool held() const { return held_; }
  void try_again() { held_ = false; }
  /// Drops the oldest that are not under way until no more than `limit` wait; gives what was dropped.
  std::vector<uint64_t> limit(size_t limit);

  [[nodiscard]] size_t size() const { return waiting_.size() + under_way_.size(); }

 private:
  using UnderWay = std::map<int, std::optional<uint64_t>>;
  UnderWay::iterator wait_again(UnderWay::iterator report);
  [[nodiscard]] bool may_publish() const {
    return connected_ && !held_ && under_way_.size() < (alone_ ? 1 : most_under_way_);
  }
  size_t most_under_way_;
  bool connected_ = false;
  bool alone_ = true;
  bool held_ = false;
  std::deque<uint64_t> waiting_;
  uint64_t newest_ = 0;
  UnderWay under_way_;  // by the client's id; nothing = not stored
};

}  // namespace railfix::tpr_publisher
