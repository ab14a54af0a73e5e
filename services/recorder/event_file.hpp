// The recording of one event: what the ring held when it happened and what came after it, written in a thread of its
// own, because a ring full of pictures takes seconds to store.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "recorder/recording.hpp"
#include "recorder/ring.hpp"

namespace railfix::recorder {

class EventFile {
 public:
  /// Protected from the beginning. `before` is written first. When more than it and `most_waiting_bytes` wait, new
  /// samples are dropped and counted as lost in the queue. Error: the file cannot be made.
  static core::Result<std::unique_ptr<EventFile>> create(const std::filesystem::path& file,
                                                         const mcap::WriterOptions& options,
                                                         const std::map<std::string, std::string>& about,
                                                         const EventNote& note, const Ring::Snapshot& before,
                                                         uint64_t most_waiting_bytes);
  /// Writes what waits, and closes the file.
  ~EventFile();
  EventFile(const EventFile&) = delete;
  EventFile& operator=(const EventFile&) = delete;

  // One thread, and before finish().
  void add(const SamplePtr& sample);
  void note(const EventNote& note);
  /// Nothing more comes: the file is closed when all that waits is written.
  void finish();

  [[nodiscard]] bool done() const { return done_; }
  /// Waits until it is done. One sentence on the file, or why it is not whole.
  core::Result<std::string> wait();
  [[nodiscard]] uint64_t waiting_bytes() const;
  [[nodiscard]] const std::filesystem::path& file() const { return recording_->file(); }

 private:
  struct Item {
    SamplePtr sample;  // null: the note
    int64_t log_time_ns = 0;
    EventNote note;
  };
  EventFile(std::unique_ptr<Recording> recording, const EventNote& note, const Ring::Snapshot& before,
            uint64_t most_waiting_bytes);
  void run();
  [[nodiscard]] std::deque<Item> take(bool& finished);

  std::unique_ptr<Recording> recording_;
  core::Status status_;  // of the writing

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<Item> items_;
  std::map<std::string, uint64_t> dropped_;  // by topic
  uint64_t waiting_bytes_ = 0;
  uint64_t most_waiting_bytes_;
  bool finished_ = false;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

}  // namespace railfix::recorder
