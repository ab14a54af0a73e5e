#include "tpr_publisher/ground_link/ground_link.hpp"

#include <chrono>

namespace railfix::tpr_publisher {

namespace {

constexpr size_t kMostUnderWay = 20;
constexpr size_t kMostUnstored = 1000;
constexpr std::chrono::seconds kRetryStore{1};

}  // namespace

GroundLink::GroundLink(const GroundLinkSettings& settings)
    : settings_(settings),
      store_(core::value_or_throw(ReportStore::open(settings.store))),
      outbox_(kMostUnderWay),
      memory_stream_(ReportStore::new_stream()),
      link_trouble_("not yet connected") {
  for (const uint64_t sequence : core::value_or_throw(store_.sequences())) outbox_.stored(sequence);
  say();
  client_ = std::make_unique<ground_link::MqttClient>(
      settings.mqtt, ground_link::MqttEvents{
                         .connected = [this] { push(Connected{}); },
                         .disconnected = [this](const std::string& why) { push(Disconnected{why}); },
                         .delivered = [this](int id) { push(Delivered{id}); },
                         .received = {},
                     });
  thread_ = std::thread([this] { run(); });
}

GroundLink::~GroundLink() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
  client_.reset();
}

void GroundLink::send(ground_link::GroundReport report) {
  push(std::move(report));
}

std::string GroundLink::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

bool GroundLink::connected() const {
  const std::lock_guard lock(mutex_);
  return connected_;
}

bool GroundLink::stores() const {
  const std::lock_guard lock(mutex_);
  return stores_;
}

void GroundLink::push(Event event) {
  {
    const std::lock_guard lock(mutex_);
    events_.push_back(std::move(event));
  }
  wake_.notify_all();
}

std::deque<GroundLink::Event> GroundLink::wait() {
  std::unique_lock lock(mutex_);
  const auto ready = [this] { return stop_ || !events_.empty(); };
  if (unstored_.empty() && delivered_.empty()) {
    wake_.wait(lock, ready);
  } else {
    wake_.wait_for(lock, kRetryStore, ready);
  }
  return std::exchange(events_, {});
}

void GroundLink::run() {
  for (bool last = false; !last;) {
    auto events = wait();
    {
      const std::lock_guard lock(mutex_);
      last = stop_ && events.empty() && events_.empty();
    }
    for (auto& event : events) take(event);
    if (!unstored_.empty() || !delivered_.empty()) store_trouble_.clear();  // unless it is met again
    remove_delivered();
    store_new();
    publish();
    say();
  }
}

void GroundLink::take(Event& event) {
  if (auto* report = std::get_if<ground_link::GroundReport>(&event)) {
    unstored_.push_back(std::move(*report));
  } else if (std::holds_alternative<Connected>(event)) {
    link_trouble_.clear();
    outbox_.connected();
  } else if (const auto* lost = std::get_if<Disconnected>(&event)) {
    link_trouble_ =
        "not connected to " + settings_.mqtt.host + ":" + std::to_string(settings_.mqtt.port) + " (" + lost->why + ")";
    outbox_.disconnected();
  } else if (const auto sequence = outbox_.delivered(std::get<Delivered>(event).id)) {
    delivered_.push_back(*sequence);
  }
}

// In one go: when that is lost in a power cut they are only sent again.
void GroundLink::remove_delivered() {
  const auto removed = store_.remove(delivered_);
  if (removed.ok()) {
    delivered_.clear();
  } else {
    store_trouble_ = removed.error().message;
  }
}

void GroundLink::store_new() {
  while (!unstored_.empty()) {
    const auto sequence = store_.append(ground_link::to_bytes(unstored_.front()));
    if (!sequence.ok()) {
      store_trouble_ = sequence.error().message;
      while (unstored_.size() > kMostUnstored) {
        unstored_.pop_front();
        ++dropped_;
      }
      return;
    }
    outbox_.stored(sequence.value());
    unstored_.pop_front();
  }
  const auto dropped = outbox_.limit(settings_.store_limit);
  dropped_ += dropped.size();
  if (const auto removed = store_.remove(dropped); !removed.ok()) store_trouble_ = removed.error().message;
}

void GroundLink::publish() {
  publish_stored();
  publish_unstored();
}

std::optional<int> GroundLink::give(ground_link::GroundReport report, uint64_t stream, uint64_t sequence) {
  report.stream = stream;
  report.sequence = sequence;
  const auto id = client_->publish(settings_.topic, ground_link::to_bytes(report));
  if (id.ok()) return id.value();
  link_trouble_ = id.error().message;  // again next time something happens
  return std::nullopt;
}

void GroundLink::publish_unstored() {
  while (!unstored_.empty() && outbox_.takes_unstored()) {
    const auto id = give(unstored_.front(), memory_stream_, memory_sequence_ + 1);
    if (!id) return;
    ++memory_sequence_;
    outbox_.published_unstored(*id);
    unstored_.pop_front();
  }
}

void GroundLink::publish_stored() {
  while (const auto sequence = outbox_.next()) {
    const auto bytes = store_.read(*sequence);
    const auto report = bytes.ok() ? ground_link::ground_report_from(bytes.value())
                                   : core::Result<ground_link::GroundReport>(bytes.error());
    if (!report.ok()) {
      store_trouble_ = report.error().message;
      ++dropped_;
      outbox_.skip();
      continue;
    }
    const auto id = give(report.value(), store_.stream(), *sequence);
    if (!id) return;
    outbox_.published(*id);
  }
}

void GroundLink::say() {
  std::string sentence;
  if (!link_trouble_.empty()) {
    sentence =
        "Ground link: " + link_trouble_ + "; " + std::to_string(outbox_.size() + unstored_.size()) + " reports wait.";
  }
  if (dropped_ > 0)
    sentence += (sentence.empty() ? "" : " ") + std::to_string(dropped_) + " reports for the ground are lost.";
  const std::string storing =
      store_trouble_.empty() ? ""
                             : store_trouble_ + " Reports go from memory, and a power cut would lose those that wait.";
  for (const auto& trouble : {storing, store_.problem()}) {
    if (!trouble.empty()) sentence += (sentence.empty() ? "" : " ") + trouble;
  }
  const std::lock_guard lock(mutex_);
  trouble_ = sentence;
  connected_ = link_trouble_.empty();
  stores_ = store_trouble_.empty();
}

}  // namespace railfix::tpr_publisher
