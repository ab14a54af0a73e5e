#include "tpr_publisher/ground_link/outbox.hpp"

namespace railfix::tpr_publisher {

void Outbox::connected() {
  connected_ = true;
  repeating_ = !under_way_.empty();
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
  if (under_way_.empty()) repeating_ = false;
  return sequence;
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
