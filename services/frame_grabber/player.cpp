#include "frame_grabber/player.hpp"

#include "core/time.hpp"
#include "frame_grabber/pace.hpp"

namespace railfix::frame_grabber {

ReadAhead::ReadAhead(std::unique_ptr<dataset::PictureSource> source, size_t depth, TooLate too_late)
    : source_(std::move(source)), depth_(depth), too_late_(std::move(too_late)), thread_([this] { decode(); }) {}

ReadAhead::~ReadAhead() {
  stop();
  thread_.join();
}

void ReadAhead::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

std::vector<int64_t> ReadAhead::skip_late(int64_t decode_ns) {
  std::vector<int64_t> left_out_ns;
  for (auto stamp_ns = source_->next_stamp_ns(); stamp_ns; stamp_ns = source_->next_stamp_ns()) {
    if (*stamp_ns <= newest_ns_) break;
    newest_ns_ = *stamp_ns;
    if (!too_late_(*stamp_ns, decode_ns) || !source_->skip()) break;
    left_out_ns.push_back(*stamp_ns);
  }
  return left_out_ns;
}

void ReadAhead::decode() {
  int64_t decode_ns = 0;  // running mean
  while (true) {
    auto left_out_ns = skip_late(decode_ns);
    const int64_t begin_ns = core::monotonic_ns();
    Item item{std::move(left_out_ns), source_->next()};
    decode_ns += (core::monotonic_ns() - begin_ns - decode_ns) / 4;
    const bool last = item.picture.ok() && !item.picture.value();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopped_ || items_.size() < depth_; });
    if (stopped_) return;
    ended_ = last;
    items_.push_back(std::move(item));
    changed_.notify_all();
    if (last) return;
  }
}

ReadAhead::Item ReadAhead::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || ended_ || !items_.empty(); });
  if (stopped_ || items_.empty()) return {};
  Item item = std::move(items_.front());
  items_.pop_front();
  changed_.notify_all();
  return item;
}

namespace {

// Passes over the pictures whose time has gone by; gives wall clock minus stamp.
std::optional<int64_t> pass_over(dataset::PictureSource& source, std::optional<int64_t> began_ns) {
  const auto first_ns = source.next_stamp_ns();
  if (!began_ns || !first_ns) return std::nullopt;
  const int64_t anchor_ns = *began_ns - *first_ns;
  for (auto next_ns = first_ns; next_ns && *next_ns + anchor_ns < core::wall_ns(); next_ns = source.next_stamp_ns()) {
    if (!source.skip()) break;
  }
  return anchor_ns;
}

}  // namespace

Player::Player(std::unique_ptr<dataset::PictureSource> source, bool real_pace, size_t read_ahead, PlayerEvents events,
               std::optional<int64_t> began_ns)
    : real_pace_(real_pace),
      wall_minus_monotonic_ns_(core::wall_ns() - core::monotonic_ns()),
      anchor_ns_(real_pace ? pass_over(*source, began_ns) : std::nullopt),
      events_(std::move(events)),
      pictures_(std::move(source), read_ahead,
                [this](int64_t stamp_ns, int64_t decode_ns) { return too_late(stamp_ns, decode_ns); }),
      thread_([this] { play(); }) {}

bool Player::too_late(int64_t stamp_ns, int64_t decode_ns) const {
  const int64_t offset_ns = due_minus_stamp_ns_;
  return real_pace_ && offset_ns != kNotBegun && now_ns() + decode_ns > stamp_ns + offset_ns;
}

Player::~Player() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  pictures_.stop();
  thread_.join();
}

void Player::complete() {
  const std::lock_guard lock(mutex_);
  complete_ = true;
  changed_.notify_all();
}

int64_t Player::now_ns() const {
  return core::monotonic_ns() + wall_minus_monotonic_ns_;
}

bool Player::wait_until(int64_t due_ns) {
  std::unique_lock lock(mutex_);
  const auto due = std::chrono::steady_clock::now() + std::chrono::nanoseconds(due_ns - now_ns());
  return !changed_.wait_until(lock, due, [this] { return stopped_; });
}

bool Player::wait_complete() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || complete_; });
  complete_ = false;
  return !stopped_;
}

void Player::play() {
  RealPace pace(anchor_ns_);
  while (true) {
    ReadAhead::Item item = pictures_.next();
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) return;
    }
    for (const int64_t stamp_ns : item.left_out_ns) events_.late(stamp_ns);
    if (!item.picture.ok()) {
      events_.broken(item.picture.error().message);
      continue;
    }
    if (!item.picture.value()) return events_.ended();
    dataset::Picture picture = std::move(*std::move(item.picture).value());
    if (real_pace_) {
      const auto verdict = pace.ask(picture.stamp_ns, now_ns());
      due_minus_stamp_ns_ = pace.due_minus_stamp_ns();
      if (verdict.skip) {
        events_.late(picture.stamp_ns);
        continue;
      }
      if (!wait_until(verdict.due_ns)) return;
    }
    events_.picture(std::move(picture));
    if (!wait_complete()) return;
  }
}

}  // namespace railfix::frame_grabber
