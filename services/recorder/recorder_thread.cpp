#include "recorder/recorder_thread.hpp"

#include <algorithm>

#include "cdr/decode.hpp"
#include "core/time.hpp"
#include "recorder/pictures.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr int64_t kTickNs = core::kNsPerSecond / 4;
constexpr size_t kEncodedWaiting = 256;
constexpr double kBytesPerMb = 1e6;

mcap::Compression compression_of(const std::string& name) {
  if (name == "none") return mcap::Compression::none;
  return name == "lz4" ? mcap::Compression::lz4 : mcap::Compression::zstd;
}

/// These have one topic for each camera.
bool per_camera(const std::string& topic) {
  return topic == "camera_frame" || topic == "camera_preview";
}

}  // namespace

RecorderThread::RecorderThread(const RecorderConfig& config, messaging::Participant& participant,
                               std::map<std::string, std::string> about, std::function<void(int64_t)> on_picture)
    : config_(config), participant_(participant), about_(std::move(about)), on_picture_(std::move(on_picture)) {
  writer_thread_ = std::thread([this] { turn(); });
  encoder_thread_ = std::thread([this] {
    while (!ending_) encode_queue_.run_one(core::monotonic_ns() + kTickNs);
  });
}

RecorderThread::~RecorderThread() {
  (void)stop();
  ending_ = true;
  queue_.push(nullptr, [] {});
  encode_queue_.push(nullptr, [] {});
  writer_thread_.join();
  encoder_thread_.join();
}

core::Result<std::string> RecorderThread::in_thread(const std::function<core::Result<std::string>()>& work) {
  std::promise<core::Result<std::string>> promise;
  auto result = promise.get_future();
  queue_.push(nullptr, [&] {
    auto done = work();
    publish_state();
    promise.set_value(std::move(done));
  });
  return result.get();
}

core::Result<std::string> RecorderThread::start(const fs::path& file) {
  return in_thread([this, file] { return begin(file); });
}

core::Result<std::string> RecorderThread::stop() {
  return in_thread([this] { return end(); });
}

RecorderState RecorderThread::state() const {
  const std::lock_guard lock(state_mutex_);
  return state_;
}

core::Result<std::string> RecorderThread::begin(const fs::path& file) {
  if (recording_) return core::Error{recording_->file().string() + " is being recorded already; stop it first"};
  const fs::path name = !file.empty()           ? file
                        : !config_.file.empty() ? fs::path(config_.file)
                                                : new_name(config_.folder, about_.at("train_id"), core::wall_ns());
  standing_.clear();
  const auto created = create(name);
  if (!created.ok()) return created.error();
  for (const auto& topic : messaging::all_topics()) {
    if (!per_camera(topic.name)) {
      listen(topic, "");
      continue;
    }
    for (const auto& camera : config_.cameras) listen(topic, camera);
  }
  find_cameras();
  return name.string();
}

core::Status RecorderThread::create(const fs::path& file) {
  mcap::WriterOptions options;
  options.chunk_bytes = static_cast<uint64_t>(config_.chunk_mb * kBytesPerMb);
  options.chunk_age_s = config_.chunk_age_s;
  options.sync_period_s = config_.sync_period_s;
  options.compression = compression_of(config_.compression);
  options.overwrite = !config_.file.empty() && file == config_.file;
  options.library = "railfix recorder " + about_.at("version");
  about_["started_ns"] = std::to_string(core::wall_ns());
  auto recording = Recording::create(file, options, about_);
  if (!recording.ok()) {
    problem_ = recording.error().message;
    return recording.error();
  }
  recording_ = std::move(recording).value();
  recording_begun_ns_ = core::monotonic_ns();
  problem_.clear();
  return {};
}

void RecorderThread::split_if_due() {
  if (!config_.file.empty() && recording_->file() == config_.file) return;
  const bool large = config_.split_mb > 0 && static_cast<double>(recording_->bytes()) >= config_.split_mb * kBytesPerMb;
  const double age_s = core::seconds(core::monotonic_ns() - recording_begun_ns_);
  if (!large && (config_.split_min <= 0 || age_s < config_.split_min * 60)) return;
  count_dropped();
  const auto closed = recording_->close();
  recording_.reset();
  if (!create(new_name(config_.folder, about_.at("train_id"), core::wall_ns())).ok()) return;
  if (!closed.ok()) problem_ = closed.error().message;
  for (auto& [name, listening] : listening_) {
    listening.dropped_before = listening.reader->dropped();
    listening.encoded_dropped_before = queue_.dropped(listening.encoded);
  }
  for (const auto& [key, standing] : standing_) {
    const auto sequence = static_cast<uint32_t>(standing.info.sequence);
    const auto status =
        recording_->write(standing.channel, {0, sequence, core::wall_ns(), standing.info.source_ns, standing.cdr});
    if (!status.ok()) problem_ = status.error().message;
  }
}

void RecorderThread::keep_standing(const ChannelOf& channel, const messaging::SampleInfo& info,
                                   const std::vector<uint8_t>& cdr) {
  if (channel.metadata.at("transient_local") != "true") return;
  std::string key = channel.topic;
  if (const auto* type = cdr::own_types().find(channel.type)) {
    const auto sample = cdr::decode(cdr::own_types(), channel.type, cdr);
    for (const auto& member : type->members) {
      if (member.key && sample.ok()) key += "\n" + sample.value()[member.name].dump();
    }
  }
  standing_[key] = {channel, info, cdr};
}

core::Result<std::string> RecorderThread::end() {
  if (!recording_) return core::Error{"nothing is being recorded"};
  stop_listening();
  const std::string summary = recording_->file().string() + ": " + std::to_string(recording_->samples()) + " samples";
  const std::string losses = recording_->loss_text();
  const auto status = recording_->close();
  recording_.reset();
  if (!status.ok()) {
    problem_ = status.error().message;
    return status.error();
  }
  return summary + (losses.empty() ? "" : ", lost " + losses);
}

// What waits for the encoder and then for the disk still belongs to the recording.
void RecorderThread::stop_listening() {
  // Pictures' readers go away in the encoder's thread, where none of their handlers can be running.
  std::promise<void> encoded;
  encode_queue_.push(nullptr, [&] {
    count_dropped();
    for (auto& [name, listening] : listening_) {
      if (listening.cause == Loss::encoder) listening.reader.reset();
    }
    encoded.set_value();
  });
  encoded.get_future().wait();
  while (queue_.run_one(0)) {
  }
  count_dropped();
  listening_.clear();
}

void RecorderThread::count_dropped() {
  if (!recording_) return;
  for (auto& [name, listening] : listening_) {
    if (listening.reader) {
      recording_->set_dropped(name, listening.cause, listening.reader->dropped() - listening.dropped_before);
    }
    const uint64_t encoded = queue_.dropped(listening.encoded) - listening.encoded_dropped_before;
    if (encoded > 0) recording_->set_dropped(name, Loss::queue, encoded);
  }
}

void RecorderThread::turn() {
  while (!ending_) {
    queue_.run_one(core::monotonic_ns() + kTickNs);
    if (core::monotonic_ns() - ticked_ns_ >= kTickNs) tick();
  }
}

void RecorderThread::tick() {
  ticked_ns_ = core::monotonic_ns();
  if (recording_) {
    find_cameras();
    count_dropped();
    const auto status = recording_->tick(ticked_ns_);
    if (!status.ok()) problem_ = status.error().message;
    split_if_due();
    if (recording_) guard_disk();
  }
  publish_state();
}

void RecorderThread::guard_disk() {
  std::error_code failed;
  const auto file = recording_->file();
  const auto space = fs::space(file.has_parent_path() ? file.parent_path() : fs::path("."), failed);
  if (failed || static_cast<double>(space.available) >= config_.keep_free_mb * kBytesPerMb) return;
  stop_listening();
  (void)recording_->close();
  recording_.reset();
  problem_ = "recording stopped: the disk of " + file.string() + " has less than " +
             std::to_string(static_cast<int64_t>(config_.keep_free_mb)) + " MB free";
}

void RecorderThread::publish_state() {
  RecorderState now;
  now.recording = recording_ != nullptr;
  now.received = received_;
  now.written = written_;
  now.problem = problem_;
  if (recording_) {
    now.file = recording_->file().string();
    now.lost = recording_->lost_samples();
    now.losses = recording_->loss_text();
  }
  const std::lock_guard lock(state_mutex_);
  state_ = std::move(now);
}

bool RecorderThread::left_out(const std::string& topic) const {
  const std::string base = topic.substr(0, topic.find('/'));
  const auto is = [&](const std::string& name) { return name == topic || name == base; };
  return std::ranges::any_of(config_.leave_out, is) || (base == "camera_frame" && config_.pictures == "none");
}

void RecorderThread::find_cameras() {
  for (const auto& name : participant_.written_topics()) {
    const size_t slash = name.find('/');
    const auto* topic = messaging::find_topic(name);
    if (topic != nullptr && slash != std::string::npos) listen(*topic, name.substr(slash + 1));
  }
}

ChannelOf RecorderThread::channel_of(const messaging::TopicInfo& topic, const std::string& name) const {
  const auto yes_no = [](bool value) { return value ? "true" : "false"; };
  ChannelOf channel{name, topic.type->name(), std::string(cdr::own_idl(topic.idl)), {}};
  channel.metadata = {{"train_id", about_.at("train_id")},
                      {"reliable", yes_no(topic.qos.reliable)},
                      {"transient_local", yes_no(topic.qos.transient_local)},
                      {"exclusive", yes_no(topic.qos.exclusive)},
                      {"keyed", yes_no(topic.type->keyed())},
                      {"depth", std::to_string(topic.qos.depth)}};
  return channel;
}

void RecorderThread::listen(const messaging::TopicInfo& topic, const std::string& instance) {
  const std::string name = instance.empty() ? topic.name : topic.name + "/" + instance;
  if (listening_.contains(name) || left_out(name)) return;
  if (topic.name == "camera_frame" && config_.pictures == "jpeg") return listen_camera(topic, instance);
  messaging::TopicInfo info = topic;
  info.reader_queue = static_cast<size_t>(topic.name == "camera_frame" ? config_.picture_queue : config_.sample_queue);
  const auto handler = [this, channel = channel_of(topic, name), type = topic.type](
                           const Sample& sample, const messaging::SampleInfo& sample_info) {
    if (sample_info.valid) write(channel, sample_info, type->serialize(sample.get()));
  };
  listening_[name].reader = std::make_unique<messaging::AnyReader>(participant_, info, instance, queue_, handler);
}

void RecorderThread::listen_camera(const messaging::TopicInfo& topic, const std::string& instance) {
  const std::string name = topic.name + "/" + instance;
  Listening& listening = listening_[name];
  listening.cause = Loss::encoder;
  listening.encoded.limit = kEncodedWaiting;
  messaging::TopicInfo info = topic;
  info.reader_queue = static_cast<size_t>(config_.picture_queue);
  const auto handler = [this, name, &listening](const Sample& sample, const messaging::SampleInfo& sample_info) {
    if (sample_info.valid) encode(name, listening, *static_cast<const msg::CameraFrame*>(sample.get()), sample_info);
  };
  listening.reader = std::make_unique<messaging::AnyReader>(participant_, info, instance, encode_queue_, handler);
}

void RecorderThread::encode(const std::string& name, Listening& listening, const msg::CameraFrame& frame,
                            const messaging::SampleInfo& info) {
  std::vector<uint8_t> cdr;
  const bool fits = static_cast<uint64_t>(frame.width_px()) * frame.height_px() <= frame.data().size();
  if (fits && frame.seq() % static_cast<uint64_t>(config_.picture_every) == 0) {
    auto jpeg = encode_jpeg(frame.data().data(), frame.width_px(), frame.height_px(),
                            static_cast<int>(config_.picture_quality));
    if (jpeg.ok()) {
      msg::CameraPreview picture;
      picture.stamp_ns(frame.stamp_ns());
      picture.grabbed_ns(frame.grabbed_ns());
      picture.seq(frame.seq());
      picture.width_px(frame.width_px());
      picture.height_px(frame.height_px());
      picture.exposure_s(frame.exposure_s());
      picture.health(frame.health());
      picture.jpeg(std::move(jpeg).value());
      cdr = messaging::serialize(picture);
    }
  }
  queue_.push(&listening.encoded, [this, name, info, stamp_ns = frame.stamp_ns(), cdr = std::move(cdr)] {
    static const messaging::TopicInfo stored = [] {
      messaging::TopicInfo as_jpeg = *messaging::find_topic("camera_frame");
      as_jpeg.type = &messaging::type_of<msg::CameraPreview>();
      return as_jpeg;
    }();
    if (cdr.empty() && recording_) recording_->note_sequence(name, info.writer, info.sequence);
    if (!cdr.empty()) write(channel_of(stored, name), info, cdr);
    on_picture_(stamp_ns);
  });
}

void RecorderThread::write(const ChannelOf& channel, const messaging::SampleInfo& info,
                           const std::vector<uint8_t>& cdr) {
  if (!recording_) return;
  ++received_;
  recording_->note_sequence(channel.topic, info.writer, info.sequence);
  const auto status =
      recording_->write(channel, {0, static_cast<uint32_t>(info.sequence), info.received_ns, info.source_ns, cdr});
  keep_standing(channel, info, cdr);
  if (status.ok()) {
    ++written_;
    problem_.clear();
  } else {
    problem_ = status.error().message;
  }
}

}  // namespace railfix::recorder
