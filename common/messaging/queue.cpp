#include <algorithm>

#include "core/time.hpp"
#include "messaging/messaging.hpp"

namespace railfix::messaging {

void Queue::push(Source* source, std::function<void()> work) {
  {
    const std::lock_guard lock(mutex_);
    if (source != nullptr) {
      if (source->limit > 0 && source->waiting >= source->limit) {
        const auto oldest =
            std::find_if(items_.begin(), items_.end(), [&](const Item& item) { return item.source == source; });
        items_.erase(oldest);
        --source->waiting;
        ++source->dropped;
        ++dropped_;
      }
      ++source->waiting;
    }
    items_.push_back({source, std::move(work)});
  }
  filled_.notify_one();
}

bool Queue::run_one(int64_t deadline_ns) {
  std::function<void()> work;
  {
    std::unique_lock lock(mutex_);
    while (items_.empty()) {
      const int64_t left_ns = deadline_ns - core::monotonic_ns();
      if (left_ns <= 0) return false;
      filled_.wait_for(lock, std::chrono::nanoseconds(left_ns));
    }
    Item& item = items_.front();
    if (item.source != nullptr) --item.source->waiting;
    work = std::move(item.work);
    items_.pop_front();
  }
  work();
  return true;
}

void Queue::forget(const Source* source) {
  const std::lock_guard lock(mutex_);
  std::erase_if(items_, [&](const Item& item) { return item.source == source; });
}

uint64_t Queue::dropped(const Source& source) const {
  const std::lock_guard lock(mutex_);
  return source.dropped;
}

uint64_t Queue::take_dropped() {
  const std::lock_guard lock(mutex_);
  return std::exchange(dropped_, 0);
}

}  // namespace railfix::messaging
