// Plays a picture source: one thread decodes ahead into a bounded queue, another waits until each picture is due and
// hands it over. Neither ever waits for the other longer than the queue demands, so decoding does not delay the pace.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "dataset/dataset.hpp"

namespace railfix::frame_grabber {

/// Decodes in a thread of its own, at most `depth` pictures ahead.
class ReadAhead {
 public:
  /// Says whether a picture would be too late when it takes decode_ns to decode: it is then left out undecoded. Asked
  /// in the decoder's thread, and only for pictures newer than all before: an older one is due at once, never late.
  using TooLate = std::function<bool(int64_t stamp_ns, int64_t decode_ns)>;
  ReadAhead(std::unique_ptr<dataset::PictureSource> source, size_t depth, TooLate too_late);
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  struct Item {
    std::vector<int64_t> left_out_ns;  // stamps of the pictures that were left out before this one
    core::Result<std::optional<dataset::Picture>> picture = std::optional<dataset::Picture>();
  };
  /// As PictureSource::next(); waits for the decoder. At the end, and after stop(), an item without a picture.
  Item next();
  void stop();

 private:
  void decode();
  [[nodiscard]] std::vector<int64_t> skip_late(int64_t decode_ns);
  std::unique_ptr<dataset::PictureSource> source_;
  size_t depth_;
  TooLate too_late_;
  int64_t newest_ns_ = INT64_MIN;  // stamp, of the pictures read or left out so far
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Item> items_;
  bool stopped_ = false;
  bool ended_ = false;
  std::thread thread_;  // last: it uses all of the above
};

/// What becomes of the pictures; all called in one thread of the player, in the order of the source.
struct PlayerEvents {
  /// The picture is due. Playing goes on after Player::complete().
  std::function<void(dataset::Picture picture)> picture;
  std::function<void(int64_t stamp_ns)> late;  // skipped: more than one period late, or going to be
  std::function<void(const std::string& why)> broken;
  std::function<void()> ended;
};

class Player {
 public:
  /// Starts at once. real_pace false: the next picture comes as soon as the last one is complete. began_ns, with real
  /// pace: when the first picture was due, by the wall clock as it is set now; those that would have been played by now
  /// are passed over.
  Player(std::unique_ptr<dataset::PictureSource> source, bool real_pace, size_t read_ahead, PlayerEvents events,
         std::optional<int64_t> began_ns = {});
  ~Player();
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  /// The picture that was handed over last has been dealt with. Any thread.
  void complete();

 private:
  void play();
  /// The wall clock as it went when playing began: one that is set meanwhile moves no picture.
  [[nodiscard]] int64_t now_ns() const;
  bool wait_until(int64_t due_ns);  // false: stopped
  bool wait_complete();
  bool too_late(int64_t stamp_ns, int64_t decode_ns) const;
  bool real_pace_;
  int64_t wall_minus_monotonic_ns_;
  std::optional<int64_t> anchor_ns_;  // due time by now_ns() minus stamp, where it is known beforehand
  PlayerEvents events_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopped_ = false;
  bool complete_ = false;
  static constexpr int64_t kNotBegun = INT64_MIN;
  std::atomic<int64_t> due_minus_stamp_ns_ = kNotBegun;
  ReadAhead pictures_;  // its thread uses all of the above
  std::thread thread_;
};

}  // namespace railfix::frame_grabber
