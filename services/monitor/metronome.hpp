// Beats in a steady period while it is wanted, in a thread of its own that sleeps otherwise: a timer of the run loop
// would wake the processor all the time.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace railfix::monitor {

class Metronome {
 public:
  /// `beat` is called in the metronome's thread.
  Metronome(std::chrono::milliseconds period, std::function<void()> beat)
      : period_(period), beat_(std::move(beat)), thread_([this] { run(); }) {}
  ~Metronome() {
    set(false, true);
    thread_.join();
  }
  Metronome(const Metronome&) = delete;
  Metronome& operator=(const Metronome&) = delete;

  void want(bool wanted) { set(wanted, false); }

 private:
  void set(bool wanted, bool ended) {
    const std::lock_guard lock(mutex_);
    if (wanted == wanted_ && !ended) return;
    wanted_ = wanted;
    ended_ = ended;
    changed_.notify_one();
  }
  void run() {
    std::unique_lock lock(mutex_);
    auto due = std::chrono::steady_clock::now();
    while (!ended_) {
      changed_.wait(lock, [this] { return wanted_ || ended_; });
      due = std::max(due + period_, std::chrono::steady_clock::now());
      if (changed_.wait_until(lock, due, [this] { return !wanted_ || ended_; })) continue;
      beat_();
    }
  }

  std::chrono::milliseconds period_;
  std::function<void()> beat_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool wanted_ = false;
  bool ended_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace railfix::monitor
