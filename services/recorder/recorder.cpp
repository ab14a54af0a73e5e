#include "recorder/recorder.hpp"

#include <utility>

#include "core/time.hpp"
#include "recorder/standing.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr int64_t kTickNs = core::kNsPerSecond / 4;
constexpr int64_t kSplitAgainNs = core::kNsPerSecond;

std::string type_of_topic(const std::string& name) {
  const auto* topic = messaging::find_topic(name);
  return topic == nullptr ? "" : topic->type->name();
}

}  // namespace

Recorder::Recorder(const RecorderConfig& config, messaging::Participant& participant,
                   const std::map<std::string, std::string>& about, std::function<void(int64_t)> on_picture,
                   FreeSpace free_space)
    : config_(config), maker_(config, about), on_picture_(std::move(on_picture)), free_space_(std::move(free_space)) {
  for (const auto& rule : config_.events) {
    rules_.push_back(core::value_or_throw(EventRule::parse(rule, type_of_topic)));
  }
  for (const auto& topic : config_.leave_out) {
    if (messaging::find_topic(topic) == nullptr)
      throw core::BadInput("recorder.leave_out names the topic '" + topic +
                           "', which there is not; `railfix topics qos` shows all");
  }
  // With `file` the folder belongs to somebody else.
  const bool ours = config_.file.empty();
  const double quota_mb = ours ? config_.quota_mb : 0;
  housekeeper_ = std::make_unique<Housekeeper>(
      maker_.folder(), FolderRules{static_cast<uint64_t>(quota_mb * kBytesPerMb),
                                   static_cast<uint64_t>(config_.keep_free_mb * kBytesPerMb), ours});
  inlet_ = std::make_unique<TopicInlet>(config_, participant, about.at("train_id"), queue_,
                                        [this](const Arrival& arrival) { use(arrival); });
  if (config_.ring_s > 0) ring_.emplace(config_.ring_s, static_cast<uint64_t>(config_.ring_mb * kBytesPerMb));
  writer_thread_ = std::thread([this] { run(); });
  if (!ring_) return;
  const auto opened = in_thread([this]() -> core::Result<std::string> {
    const auto status = inlet_->open();
    if (!status.ok()) return status.error();
    return std::string();
  });
  if (opened.ok()) return;
  close_all();
  throw core::BadInput(opened.error());
}

Recorder::~Recorder() {
  close_all();
}

void Recorder::close_all() {
  (void)in_thread([this] { return recording_ ? end() : std::string(); });
  (void)in_thread([this] {
    drain([this] { inlet_->close(); });
    tend_event_files(true);
    return std::string();
  });
  ending_ = true;
  queue_.push(nullptr, [] {});
  writer_thread_.join();
}

core::Result<std::string> Recorder::in_thread(const std::function<core::Result<std::string>()>& work) {
  std::promise<core::Result<std::string>> promise;
  auto result = promise.get_future();
  const std::function<void()> task = [&] {
    // In the middle of what the thread does with the file by itself, as for a full disk: behind it.
    if (draining_) return queue_.push(nullptr, task);
    try {
      auto done = work();
      publish_state();
      promise.set_value(std::move(done));
    } catch (const std::exception& error) {
      promise.set_value(core::Error{error.what()});
    }
  };
  queue_.push(nullptr, task);
  return result.get();
}

void Recorder::drain(const std::function<void()>& inlet_does) {
  draining_ = true;
  const std::shared_ptr<void> done(nullptr, [this](void*) { draining_ = false; });
  inlet_does();
}

core::Result<std::string> Recorder::start(const fs::path& file) {
  return in_thread([this, file] { return begin(file); });
}

core::Result<std::string> Recorder::stop() {
  return in_thread([this]() -> core::Result<std::string> {
    if (!std::exchange(goes_on_by_itself_, false)) return end();
    problem_.clear();
    return std::string("recording had stopped already, and does not go on by itself");
  });
}

core::Result<std::string> Recorder::pause() {
  return in_thread([this] { return set_paused(true); });
}

core::Result<std::string> Recorder::resume() {
  return in_thread([this] { return set_paused(false); });
}

RecorderState Recorder::state() const {
  const std::lock_guard lock(state_mutex_);
  return state_;
}

RecorderState Recorder::take_state() {
  const std::lock_guard lock(state_mutex_);
  RecorderState taken = state_;
  state_.news.clear();
  return taken;
}

core::Result<std::string> Recorder::begin(const fs::path& file) {
  if (recording_) return core::Error{recording_->file().string() + " is being recorded already; stop it first"};
  const fs::path name = file.empty() ? maker_.next_name() : maker_.named(file);
  if (disk_has_less_than(1, name)) return refuse_without_room(name, !file.empty());
  count_dropped();  // not of this file
  auto created = file.empty() ? maker_.create_next(name) : maker_.create(name);
  for (const auto& sentence : maker_.take_warnings()) say(sentence, true);
  if (!created.ok()) {
    problem_ = created.error().message;
    return created.error();
  }
  record_into(std::move(created).value());
  paused_ = false;
  goes_on_by_itself_ = false;
  inlet_->want_recorded(true);
  if (inlet_->is_open()) {
    write_standing();
  } else {
    standing_.clear();
    dropped_.clear();
    const auto opened = inlet_->open();
    if (!opened.ok()) {
      (void)end();
      problem_ = opened.error().message;
      return opened.error();
    }
  }
  return name.string();
}

void Recorder::record_into(std::unique_ptr<Recording> recording) {
  recording_ = std::move(recording);
  opened_wall_ns_ = core::wall_ns();
  opened_monotonic_ns_ = core::monotonic_ns();
  rated_ns_ = opened_monotonic_ns_;
  rated_bytes_ = 0;
  problem_.clear();
  split_problem_.clear();
}

// The next file is there before the old one is closed: if it cannot be made, the old one goes on, and it is tried
// again.
void Recorder::split_if_due() {
  if (!config_.file.empty()) return;
  const bool large = config_.split_mb > 0 && static_cast<double>(recording_->bytes()) >= config_.split_mb * kBytesPerMb;
  const double age_s = core::seconds(core::monotonic_ns() - opened_monotonic_ns_);
  if (!large && (config_.split_min <= 0 || age_s < config_.split_min * 60)) return;
  if (!split_problem_.empty() && core::monotonic_ns() < split_again_ns_) return;
  const fs::path name = maker_.timed_name();
  auto next = maker_.create(name);
  if (!next.ok()) {
    std::error_code failed;
    for (const auto& begun : {name, fs::path(name.string() + kActive)}) fs::remove(begun, failed);
    split_problem_ = "no new file can be begun, " + recording_->file().string() + " goes on: " + next.error().message;
    split_again_ns_ = core::monotonic_ns() + kSplitAgainNs;
    return;
  }
  count_dropped();
  (void)wait_for_closing();
  // Forcing the rest of a file to the disk takes long enough for samples to pile up.
  closing_ = std::async(std::launch::async,
                        [old = std::shared_ptr<Recording>(std::move(recording_))] { return old->close(); });
  record_into(std::move(next).value());
  write_standing();
}

core::Status Recorder::wait_for_closing() {
  if (!closing_.valid()) return {};
  auto status = closing_.get();
  if (!status.ok()) say(status.error().message, true);
  return status;
}

void Recorder::write_standing() {
  for (const auto& [key, sample] : standing_) {
    const auto status = recording_->write(*sample, core::wall_ns());
    if (!status.ok()) problem_ = status.error().message;
  }
}

core::Result<std::string> Recorder::end() {
  if (!recording_) return core::Error{"nothing is being recorded"};
  // What waits for the encoder and then for the disk still belongs to the recording.
  drain([this] { ring_ ? inlet_->drain() : inlet_->close(); });
  count_dropped();
  inlet_->want_recorded(false);
  const std::string summary = recording_->file().string() + ": " + std::to_string(recording_->samples()) + " samples";
  const std::string losses = recording_->loss_text();
  const auto before = wait_for_closing();
  const auto status = recording_->close();
  recording_.reset();
  split_problem_.clear();
  paused_ = false;
  for (const auto& one : {before, status}) {
    if (one.ok()) continue;
    problem_ = one.error().message;
    return one.error();
  }
  return summary + (losses.empty() ? "" : ", lost " + losses);
}

core::Result<std::string> Recorder::set_paused(bool paused) {
  if (!recording_) return core::Error{"nothing is being recorded"};
  const std::string file = recording_->file().string();
  if (paused == paused_) return core::Error{file + (paused ? " is paused already" : " is not paused")};
  drain([this] { inlet_->drain(); });
  count_dropped();
  paused_ = paused;
  inlet_->want_recorded(!paused);
  if (paused) return file + " is paused";
  recording_->forget_sequences();
  write_standing();
  return file + " goes on";
}

void Recorder::count_dropped() {
  for (const auto& [topic, cause, total] : inlet_->dropped()) {
    uint64_t& seen = dropped_[{topic, cause}];
    if (recording_ && !paused_) recording_->add_dropped(topic, cause, total - seen);
    seen = total;
  }
}

void Recorder::run() {
  while (!ending_) {
    try {
      queue_.run_one(core::monotonic_ns() + kTickNs);
      if (core::monotonic_ns() - ticked_ns_ >= kTickNs) tick();
    } catch (const std::exception& error) {
      fail(error.what());
    }
  }
}

// Nobody knows what is still right here: the service ends, and whoever started it starts it again.
void Recorder::fail(const std::string& why) {
  try {
    if (failure_.empty()) failure_ = "the recorder's thread cannot go on: " + why;
    (void)wait_for_closing();
    if (recording_) (void)recording_->close();
    goes_on_by_itself_ = false;
    recording_.reset();
    publish_state();
  } catch (const std::exception&) {
    const std::lock_guard lock(state_mutex_);
    state_.failure = failure_;
  }
}

void Recorder::tick() {
  ticked_ns_ = core::monotonic_ns();
  if (inlet_->is_open()) inlet_->find_cameras();
  for (const auto& sentence : inlet_->take_refused()) say(sentence, true);
  count_dropped();
  if (recording_) {
    const auto status = recording_->tick(ticked_ns_);
    if (!status.ok()) problem_ = status.error().message;
    if (recording_->is_removed()) {
      leave_removed_file();
    } else {
      split_if_due();
    }
  }
  guard_disk();
  go_on_by_itself();
  tend_event_files(false);
  publish_state();
}

void Recorder::use(const Arrival& arrival) {
  if (recording_ && !paused_) record(arrival);
  const SamplePtr& sample = arrival.recorded ? arrival.recorded : arrival.ringed;
  if (sample && !sample->standing.empty()) standing_[sample->standing] = sample;
  if (ring_ && arrival.ringed) {
    ring_->add(arrival.ringed, core::monotonic_ns());
    if (event_file_) event_file_->add(arrival.ringed);
  }
  // What services said long before is in the recording, and no event of now.
  if (sample && (arrival.live || !is_said_once(arrival.topic))) look_for_events(*sample);
  if (arrival.picture_stamp_ns) on_picture_(*arrival.picture_stamp_ns);
}

void Recorder::record(const Arrival& arrival) {
  const std::string topic(arrival.topic);
  const auto* known = messaging::find_topic(topic);
  // Of a topic that is one sample deep only the newest is promised.
  if (arrival.live && (known == nullptr || known->qos.depth > 1))
    recording_->note_sequence(topic, arrival.writer, arrival.sequence, known != nullptr && known->qos.exclusive);
  if (!arrival.recorded) return;
  ++received_;
  const auto status = recording_->write(*arrival.recorded);
  if (status.ok()) {
    ++written_;
    problem_.clear();
  } else {
    problem_ = status.error().message;
  }
}

void Recorder::publish_state() {
  RecorderState now;
  now.recording = recording_ != nullptr;
  now.paused = paused_;
  now.ring = ring_.has_value();
  now.is_wanted = config_.autostart;
  now.goes_on_by_itself = goes_on_by_itself_;
  now.ring_s = ring_ ? ring_->seconds() : 0;
  now.received = received_;
  now.written = written_;
  now.problem = problem_.empty() ? split_problem_ : problem_;
  now.failure = failure_;
  now.event = event_;
  now.waiting_bytes = inlet_->waiting_bytes();
  if (event_file_) now.waiting_bytes += event_file_->waiting_bytes();
  for (const auto& closing : closing_events_) now.waiting_bytes += closing->waiting_bytes();
  if (recording_) {
    now.file = recording_->file().string();
    now.started_ns = opened_wall_ns_;
    now.messages = recording_->samples();
    now.bytes = recording_->bytes();
    now.lost = recording_->lost_samples();
    now.losses = recording_->loss_text();
    now.losses_by_topic = recording_->losses_by_topic();
    const int64_t since_ns = core::monotonic_ns() - rated_ns_;
    if (since_ns >= core::kNsPerSecond) {
      bytes_per_s_ = static_cast<double>(now.bytes - rated_bytes_) / core::seconds(since_ns);
      rated_ns_ += since_ns;
      rated_bytes_ = now.bytes;
    }
    now.bytes_per_s = bytes_per_s_;
  }
  const std::lock_guard lock(state_mutex_);
  now.news = std::move(state_.news);
  state_ = std::move(now);
}

void Recorder::say(const std::string& sentence, bool bad) {
  const std::lock_guard lock(state_mutex_);
  state_.news.push_back({sentence, bad});
}

}  // namespace railfix::recorder
