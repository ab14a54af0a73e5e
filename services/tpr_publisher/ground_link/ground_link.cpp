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
  if (unstored_.empty()) {
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
    std::vector<uint64_t> done;
    for (auto& event : events) take(event, done);
    // Removed in one go: when that is lost in a power cut they are only sent again.
    if (const auto removed = store_.remove(done); !removed.ok()) store_trouble_ = removed.error().message;
    store_new();
    publish();
    say();
  }
}

void GroundLink::take(Event& event, std::vector<uint64_t>& done) {
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
    done.push_back(*sequence);
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
    store_trouble_.clear();
    outbox_.stored(sequence.value());
    unstored_.pop_front();
  }
  const auto dropped = outbox_.limit(settings_.store_limit);
  dropped_ += dropped.size();
  if (const auto removed = store_.remove(dropped); !removed.ok()) store_trouble_ = removed.error().message;
}

void GroundLink::publish() {
  while (const auto sequence = outbox_.next()) {
    const auto bytes = store_.read(*sequence);
    auto report = bytes.ok() ? ground_link::ground_report_from(bytes.value())
                             : core::Result<ground_link::GroundReport>(bytes.error());
    if (!report.ok()) {
      store_trouble_ = report.error().message;
      ++dropped_;
      outbox_.skip();
      continue;
    }
    report.value().stream = store_.stream();
    report.value().sequence = *sequence;
    const auto id = client_->publish(settings_.topic, ground_link::to_bytes(report.value()));
    if (!id.ok()) {
      link_trouble_ = id.error().message;
      return;  // next time something happens
    }
    outbox_.published(id.value());
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
  for (const auto& trouble : {store_trouble_, store_.problem()}) {
    if (!trouble.empty()) sentence += (sentence.empty() ? "" : " ") + trouble;
  }
  const std::lock_guard lock(mutex_);
  trouble_ = sentence;
  connected_ = link_trouble_.empty();
}

}  // namespace railfix::tpr_publisher
