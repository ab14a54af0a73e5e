#include "recorder/topic_inlet.hpp"

#include <algorithm>
#include <future>

#include "cdr/types.hpp"
#include "core/time.hpp"
#include "pictures/encode.hpp"
#include "recorder/standing.hpp"

namespace railfix::recorder {

namespace {

constexpr int64_t kPatienceNs = core::kNsPerSecond / 4;
constexpr size_t kJpegsWaiting = 256;
// Of the picture's bytes in msg::CameraPreview.
constexpr size_t kMostPictureBytes = msg::CAMERA_MAX_PIXELS;

/// These have one topic for each camera.
bool per_camera(const std::string& topic) {
  return topic == "camera_frame" || topic == "camera_preview";
}

SamplePtr stored(std::shared_ptr<const ChannelOf> channel, const messaging::SampleInfo& info,
                 std::vector<uint8_t> cdr) {
  if (cdr.empty()) return nullptr;
  std::string standing = standing_of(*channel, cdr);
  return std::make_shared<const StoredSample>(StoredSample{std::move(channel), static_cast<uint32_t>(info.sequence),
                                                           info.received_ns, info.source_ns, std::move(cdr),
                                                           std::move(standing)});
}

}  // namespace

TopicInlet::TopicInlet(const RecorderConfig& config, messaging::Participant& participant, std::string train_id,
                       messaging::Queue& queue, std::function<void(const Arrival&)> use)
    : config_(config),
      ring_pictures_(config.ring_s > 0 ? config.ring_pictures : "none"),
      participant_(participant),
      train_id_(std::move(train_id)),
      queue_(queue),
      use_(std::move(use)) {
  encoder_ = std::thread([this] {
    while (!ending_) {
      try {
        encode_queue_.run_one(core::monotonic_ns() + kPatienceNs);
      } catch (const std::exception&) {  // who drains the queue deals with it
        queue_.push(nullptr, [error = std::current_exception()] { std::rethrow_exception(error); });
      }
    }
  });
}

TopicInlet::~TopicInlet() {
  close();
  ending_ = true;
  encode_queue_.push(nullptr, [] {});
  encoder_.join();
}

core::Status TopicInlet::open() {
  if (open_) return {};
  open_ = true;
  listening_.clear();
  try {
    for (const auto& topic : messaging::all_topics()) {
      if (!per_camera(topic.name)) {
        listen(topic, "");
        continue;
      }
      for (const auto& camera : config_.cameras) listen(topic, camera);
    }
  } catch (const core::BadInput& error) {
    close();
    return core::Error{error.what()};
  }
  find_cameras();
  return {};
}

void TopicInlet::find_cameras() {
  for (const auto& name : participant_.written_topics()) {
    const size_t slash = name.find('/');
    const auto* topic = messaging::find_topic(name);
    if (topic == nullptr || slash == std::string::npos) continue;
    try {
      listen(*topic, name.substr(slash + 1));
    } catch (const core::BadInput& error) {  // anybody may write any name
      refused_.emplace_back(error.what());
    }
  }
}

void TopicInlet::in_encoder(const std::function<void()>& work) {
  const auto task = std::make_shared<std::packaged_task<void()>>(work);
  auto done = task->get_future();
  encode_queue_.push(nullptr, [task] { (*task)(); });
  done.get();
}

void TopicInlet::drain() {
  in_encoder([] {});
  const auto drained = std::make_shared<bool>(false);  // outlives us when what is run throws
  queue_.push(nullptr, [drained] { *drained = true; });
  while (!*drained) queue_.run_one(core::monotonic_ns() + kPatienceNs);
}

void TopicInlet::close() {
  if (!open_) return;
  // Pictures' readers go away in the encoder's thread, where none of their handlers can be running.
  in_encoder([this] {
    for (auto& [name, listening] : listening_) {
      if (!listening.pictures || !listening.reader) continue;
      listening.dropped_at_close = listening.reader->dropped();
      listening.reader.reset();
    }
  });
  drain();
  for (auto& [name, listening] : listening_) {
    if (!listening.reader) continue;
    listening.dropped_at_close = listening.reader->dropped();
    listening.reader.reset();
  }
  open_ = false;
}

std::vector<TopicInlet::Dropped> TopicInlet::dropped() const {
  std::vector<Dropped> all;
  for (const auto& [name, listening] : listening_) {
    all.push_back({name, listening.pictures ? Loss::encoder : Loss::queue,
                   listening.reader ? listening.reader->dropped() : listening.dropped_at_close});
    if (listening.pictures) all.push_back({name, Loss::queue, queue_.dropped(listening.encoded)});
  }
  return all;
}

bool TopicInlet::left_out(const std::string& topic) const {
  const std::string base = topic.substr(0, topic.find('/'));
  const auto is = [&](const std::string& name) { return name == topic || name == base; };
  if (std::ranges::any_of(config_.leave_out, is)) return true;
  return base == "camera_frame" && config_.pictures == "none" && ring_pictures_ == "none";
}

std::shared_ptr<const ChannelOf> TopicInlet::channel_of(const messaging::TopicInfo& topic, const messaging::Type& type,
                                                        const std::string& name) const {
  const auto yes_no = [](bool value) { return value ? "true" : "false"; };
  ChannelOf channel{name, type.name(), std::string(cdr::own_idl_of(type.name())), {}};
  channel.metadata = {{"train_id", train_id_},
                      {"reliable", yes_no(topic.qos.reliable)},
                      {"transient_local", yes_no(topic.qos.transient_local)},
                      {"exclusive", yes_no(topic.qos.exclusive)},
                      {"keyed", yes_no(topic.type->keyed())},
                      {"depth", std::to_string(topic.qos.depth)}};
  return std::make_shared<const ChannelOf>(std::move(channel));
}

void TopicInlet::listen(const messaging::TopicInfo& topic, const std::string& instance) {
  const std::string name = instance.empty() ? topic.name : topic.name + "/" + instance;
  if (listening_.contains(name) || left_out(name)) return;
  Listening& listening = listening_[name];
  if (topic.name == "camera_frame") return listen_camera(listening, topic, name, instance);
  messaging::TopicInfo info = topic;
  info.reader_queue = static_cast<size_t>(config_.sample_queue);
  // Services say why they cannot start before anybody has found them; their writers keep the last lines.
  if (topic.name == messaging::topics::log_record.name) info.qos.transient_local = true;
  const auto handler = [this, channel = channel_of(topic, *topic.type, name), type = topic.type,
                        since_ns = core::wall_ns()](const Sample& sample, const messaging::SampleInfo& sample_info) {
    const auto one = stored(channel, sample_info, type->serialize(sample.get()));
    const bool live = sample_info.source_ns >= since_ns;
    use_({channel->topic, sample_info.writer, sample_info.sequence, one, one, std::nullopt, live});
  };
  listening.reader = std::make_unique<messaging::AnyReader>(participant_, info, instance, queue_, handler);
}

void TopicInlet::listen_camera(Listening& listening, const messaging::TopicInfo& topic, const std::string& name,
                               const std::string& instance) {
  const bool full = config_.pictures == "full" || ring_pictures_ == "full";
  listening.pictures = true;
  listening.packed_pictures = channel_of(topic, messaging::type_of<msg::CameraPreview>(), name);
  listening.plain_pictures = channel_of(topic, *topic.type, name);
  listening.encoded.limit = full ? static_cast<size_t>(config_.picture_queue) : kJpegsWaiting;
  messaging::TopicInfo info = topic;
  info.reader_queue = static_cast<size_t>(config_.picture_queue);
  const auto handler = [this, name, &listening](const Sample& sample, const messaging::SampleInfo& sample_info) {
    encode(name, listening, *static_cast<const msg::CameraFrame*>(sample.get()), sample_info);
  };
  listening.reader = std::make_unique<messaging::AnyReader>(participant_, info, instance, encode_queue_, handler);
}

SamplePtr TopicInlet::encoded(const std::string& how, const Listening& listening, const msg::CameraFrame& frame,
                              const messaging::SampleInfo& info) const {
  auto bytes = how == "jpeg" ? pictures::encode_jpeg(frame.data().data(), frame.width_px(), frame.height_px(),
                                                     static_cast<int>(config_.picture_quality))
                             : pictures::encode_pgm(frame.data().data(), frame.width_px(), frame.height_px());
  if (!bytes.ok()) return nullptr;
  if (bytes.value().size() > kMostPictureBytes) {
    return stored(listening.plain_pictures, info, messaging::serialize(frame));
  }
  msg::CameraPreview picture;
  picture.stamp_ns(frame.stamp_ns());
  picture.grabbed_ns(frame.grabbed_ns());
  picture.seq(frame.seq());
  picture.width_px(frame.width_px());
  picture.height_px(frame.height_px());
  picture.exposure_s(frame.exposure_s());
  picture.health(frame.health());
  picture.jpeg(std::move(bytes).value());
  return stored(listening.packed_pictures, info, messaging::serialize(picture));
}

void TopicInlet::encode(const std::string& name, Listening& listening, const msg::CameraFrame& frame,
                        const messaging::SampleInfo& info) {
  const bool fits = static_cast<uint64_t>(frame.width_px()) * frame.height_px() <= frame.data().size();
  const bool in_recording = fits && recorded_wanted_ && config_.pictures != "none" &&
                            frame.seq() % static_cast<uint64_t>(config_.picture_every) == 0;
  SamplePtr recorded;
  SamplePtr ringed;
  if (in_recording) recorded = encoded(config_.pictures, listening, frame, info);
  if (fits && ring_pictures_ != "none") {
    const bool same = recorded && ring_pictures_ == config_.pictures;
    ringed = same ? recorded : encoded(ring_pictures_, listening, frame, info);
  }
  uint64_t bytes = recorded ? recorded->cdr.size() : 0;
  if (ringed && ringed != recorded) bytes += ringed->cdr.size();
  waiting_bytes_ += bytes;
  const std::shared_ptr<void> waits(nullptr, [this, bytes](void*) { waiting_bytes_ -= bytes; });
  queue_.push(&listening.encoded, [this, name, info, stamp_ns = frame.stamp_ns(), recorded, ringed, waits] {
    use_({name, info.writer, info.sequence, recorded, ringed, stamp_ns, true});
  });
}

}  // namespace railfix::recorder
