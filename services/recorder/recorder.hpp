// The recorder beside the service: the disk may stall in its threads without the service looking frozen.
#pragma once

#include <future>
#include <mutex>
#include <optional>
#include <thread>

#include "recorder/event_file.hpp"
#include "recorder/event_rule.hpp"
#include "recorder/housekeeper.hpp"
#include "recorder/recording_maker.hpp"
#include "recorder/recordings_folder.hpp"
#include "recorder/ring.hpp"
#include "recorder/topic_inlet.hpp"

namespace railfix::recorder {

/// What the service says about the recording.
struct RecorderState {
  bool recording = false;  // a file is open
  bool paused = false;     // ... and nothing goes into it
  bool ring = false;       // the last seconds are kept in memory
  bool is_wanted = false;  // it records from the beginning: without a file somebody, or a full disk, has stopped it
  bool goes_on_by_itself = false;  // not recording, and waits until a file can be begun: there was no room, or the
                                   // open one was removed
  std::string file;
  int64_t started_ns = 0;  // of the file
  uint64_t messages = 0;   // in the file
  uint64_t bytes = 0;      // of the file on the disk
  double bytes_per_s = 0;
  uint64_t waiting_bytes = 0;  // for the disk
  double ring_s = 0;           // how far back an event would reach
  uint64_t received = 0;       // since the program began
  uint64_t written = 0;
  uint64_t lost = 0;
  std::string losses;  // of the present recording, by topic and cause
  std::vector<TopicLosses> losses_by_topic;
  std::string problem;             // why nothing can be written, empty = all well
  std::string failure;             // why the recorder cannot go on at all
  std::optional<EventNote> event;  // the last one
  struct News {
    std::string sentence;
    bool bad;
  };
  std::vector<News> news;  // since the last call of take_state()
};

/// Bytes on the disk of a folder.
using FreeSpace = std::function<uint64_t(const std::filesystem::path& folder)>;

/// `writer_thread_` takes samples from the topics and writes them; the members are its own, but for `queue_`,
/// `housekeeper_`, `state_` and `ending_`, which any thread may use. The other threads belong to what it owns: the
/// inlet has one that encodes pictures, the housekeeper one that looks after the folder, each event's file one that
/// writes it, each open file now and then one that forces it to the disk (mcap::Writer), and after a split `closing_`
/// is one that closes the file before. They touch no member: what they have to say comes through `queue_` or is asked
/// for.
class Recorder {
 public:
  /// `on_picture` is called from the recorder's thread with the stamp of each picture that was dealt with. Throws
  /// BadInput for an event rule that cannot be meant, a topic to leave out that there is not, or one that cannot be
  /// read. `free_space`: what the disk of a folder has left; tests say something else.
  Recorder(const RecorderConfig& config, messaging::Participant& participant,
           const std::map<std::string, std::string>& about, std::function<void(int64_t stamp_ns)> on_picture,
           FreeSpace free_space = free_bytes);
  /// Closes all files.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Any thread, one after the other. They give the file's name or a sentence.
  core::Result<std::string> start(const std::filesystem::path& file);
  core::Result<std::string> stop();
  core::Result<std::string> pause();
  core::Result<std::string> resume();
  core::Result<std::string> event(const std::string& text);
  [[nodiscard]] RecorderState state() const;
  /// The same, and forgets the news.
  RecorderState take_state();
  Housekeeper& housekeeper() { return *housekeeper_; }

 private:
  void close_all();
  core::Result<std::string> in_thread(const std::function<core::Result<std::string>()>& work);
  /// Waits for what the inlet still has, while no command is carried out.
  void drain(const std::function<void()>& inlet_does);
  core::Result<std::string> begin(const std::filesystem::path& file);
  void record_into(std::unique_ptr<Recording> recording);
  core::Result<std::string> end();
  core::Result<std::string> set_paused(bool paused);
  void split_if_due();
  core::Status wait_for_closing();
  void write_standing();
  void run();
  void fail(const std::string& why);
  void tick();
  void count_dropped();
  void guard_disk();
  void leave_removed_file();
  void go_on_by_itself();
  void go_on();
  /// Less than so many times keep_free_mb are free where this file is or would be.
  [[nodiscard]] bool disk_has_less_than(double times, const std::filesystem::path& file) const;
  /// The open one, or some other where the next one would be.
  [[nodiscard]] std::filesystem::path file_on_disk() const;
  [[nodiscard]] std::string disk_is_full(const std::filesystem::path& file) const;
  core::Error refuse_without_room(const std::filesystem::path& file, bool is_named);
  /// The sentence, which is the problem until it goes on.
  std::string wait_for_room(const std::string& what, const std::filesystem::path& file);
  void publish_state();
  void use(const Arrival& arrival);
  void record(const Arrival& arrival);
  void look_for_events(const StoredSample& sample);
  core::Result<std::string> happened(const EventNote& note, bool by_hand);
  core::Result<std::string> keep_event(const EventNote& note, bool by_hand);
  void tend_event_files(bool all);
  void say(const std::string& sentence, bool bad);

  RecorderConfig config_;
  RecordingMaker maker_;
  std::function<void(int64_t)> on_picture_;
  FreeSpace free_space_;
  std::vector<EventRule> rules_;
  std::map<const EventRule*, int64_t> rule_happened_ns_;
  std::unique_ptr<Housekeeper> housekeeper_;

  messaging::Queue queue_;
  std::unique_ptr<TopicInlet> inlet_;
  std::unique_ptr<Recording> recording_;
  bool paused_ = false;
  bool draining_ = false;
  bool goes_on_by_itself_ = false;     // stopped by what may pass: a full disk, a removed file
  std::future<core::Status> closing_;  // the file before
  int64_t opened_monotonic_ns_ = 0;    // `recording_`
  int64_t opened_wall_ns_ = 0;
  std::map<std::string, SamplePtr> standing_;
  std::map<std::pair<std::string, Loss>, uint64_t> dropped_;  // seen so far
  std::optional<Ring> ring_;
  std::unique_ptr<EventFile> event_file_;
  int64_t event_begun_ns_ = 0;
  int64_t event_ends_ns_ = 0;
  std::vector<std::unique_ptr<EventFile>> closing_events_;
  std::optional<EventNote> event_;
  std::string problem_;
  std::string failure_;
  std::string split_problem_;  // why the next file could not be begun
  int64_t split_again_ns_ = 0;
  uint64_t received_ = 0;
  uint64_t written_ = 0;
  int64_t ticked_ns_ = 0;
  int64_t rated_ns_ = 0;
  uint64_t rated_bytes_ = 0;
  double bytes_per_s_ = 0;

  mutable std::mutex state_mutex_;
  RecorderState state_;
  std::atomic<bool> ending_ = false;
  std::thread writer_thread_;
};

}  // namespace railfix::recorder
