#include "tpr_publisher/ground_link/outbox.hpp"

#include <algorithm>

namespace railfix::tpr_publisher {

void Outbox::connected() {
  connected_ = true;
  alone_ = true;
}

void Outbox::disconnected() {
  connected_ = false;
  for (auto report = under_way_.begin(); report != under_way_.end();) report = wait_again(report);
}

Outbox::UnderWay::iterator Outbox::wait_again(UnderWay::iterator report) {
  if (const auto sequence = report->second) waiting_.insert(std::ranges::lower_bound(waiting_, *sequence), *sequence);
  return under_way_.erase(report);
}

std::optional<uint64_t> Outbox::next() const {
  if (!may_publish() || waiting_.empty()) return std::nullopt;
  return waiting_.front();
}

void Outbox::published(int id) {
  under_way_[id] = waiting_.front();
  waiting_.pop_front();
}

std::optional<uint64_t> Outbox::delivered(int id) {
  const auto found = under_way_.find(id);
  if (found == under_way_.end()) return std::nullopt;
  const auto sequence = found->second;
  under_way_.erase(found);
  alone_ = false;
  return sequence;
}

void Outbox::refused(int id) {
  const auto found = under_way_.find(id);
  if (found == under_way_.end()) return;
  wait_again(found);
  alone_ = held_ = true;
}

std::vector<uint64_t> Outbox::limit(size_t limit) {
  std::vector<uint64_t> dropped;
  while (waiting_.size() > limit) {
    dropped.push_back(waiting_.front());
    waiting_.pop_front();
  }
  return dropped;
}

}  // namespace railfix::tpr_publisher
