#include "tpr_publisher/ground_link/ground_link.hpp"

#include <algorithm>

namespace railfix::tpr_publisher {

namespace {

constexpr size_t kMostUnderWay = 20;
constexpr size_t kMostUnstored = 1000;
constexpr std::chrono::seconds kRetrySoon{1};  // of the store, and of what the client did not take
using Clock = std::chrono::steady_clock;

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
                         .connected = [this](auto version) { push(Connected{version}); },
                         .disconnected = [this](const std::string& why) { push(Disconnected{why}); },
                         .delivered = [this](int id) { push(Delivered{id}); },
                         .refused =
                             [this](int id, const std::string& why) {
                               push(Refused{id, why});
                             },
                         .received = {},
                         .unheard =
                             [this](int id) {
                               push(Refused{id, ""});
                             },
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

std::string GroundLink::remark() const {
  const std::lock_guard lock(mutex_);
  return remark_;
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
  const bool soon_again =
      !unstored_.empty() || !delivered_.empty() || !read_trouble_.empty() || !publish_trouble_.empty();
  auto until = Clock::now() + kRetrySoon;
  if (outbox_.held()) until = soon_again ? std::min(until, try_again_at_) : try_again_at_;
  if (soon_again || outbox_.held()) {
    wake_.wait_until(lock, until, ready);
  } else {
    wake_.wait(lock, ready);
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
    store_new(last);
    try_again();
    publish();
    say();
  }
}

void GroundLink::take(Event& event) {
  std::visit([this](auto& one) { take(one); }, event);
}

void GroundLink::take(const Connected& now) {
  link_trouble_.clear();
  outbox_.connected();
  const std::lock_guard lock(mutex_);
  remark_ = now.version == ground_link::MqttVersion::v5
                ? ""
                : "Ground link: the broker " + broker() +
                      " knows only MQTT 3.1.1, which confirms what its list of rights refuses and what nobody there "
                      "waits for: "
                      "such reports are lost unseen. Look on the ground with railfix tpr listen whether they come.";
}

void GroundLink::take(const Disconnected& lost) {
  link_trouble_ = "not connected to " + broker() + " (" + lost.why + ")";
  outbox_.disconnected();
  while (!unstored_under_way_.empty()) wait_again(unstored_under_way_.begin()->first);
}

void GroundLink::take(const Delivered& report) {
  unstored_under_way_.erase(report.id);
  if (const auto sequence = outbox_.delivered(report.id)) delivered_.push_back(*sequence);
  if (!outbox_.held()) refusal_.clear();
}

void GroundLink::take(const Refused& report) {
  if (!outbox_.held()) try_again_at_ = Clock::now() + pause();
  outbox_.refused(report.id);
  refusal_ = report.why.empty() ? nobody_listens() : refused_because(report.why);
  wait_again(report.id);
}

std::string GroundLink::nobody_listens() const {
  return "nobody on the ground has subscribed to " + settings_.topic + " at " + broker() +
         "; start who listens there (as railfix tpr listen)";
}

std::string GroundLink::refused_because(const std::string& why) const {
  const std::string user = settings_.mqtt.user.empty() ? "a client without a user name" : "user " + settings_.mqtt.user;
  return "the broker " + broker() + " refuses what " + user + " writes to " + settings_.topic + " (" + why +
         "); let it write there in the broker's list of rights (acl_file)";
}

// With its number: under another one the ground would miss this one.
void GroundLink::wait_again(int id) {
  auto unstored = unstored_under_way_.extract(id);
  if (!unstored) return;
  const auto later = [&](const auto& one) {
    return !one.has_number() || one.report.sequence > unstored.mapped().report.sequence;
  };
  unstored_.insert(std::ranges::find_if(unstored_, later), std::move(unstored.mapped()));
}

void GroundLink::try_again() {
  if (outbox_.held() && Clock::now() >= try_again_at_) outbox_.try_again();
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

// One that has a number of the memory's stream keeps it, stored at the end at most: the broker may have it already, and
// the ground would miss that number.
void GroundLink::store_new(bool all) {
  const auto has_none = [](const Unstored& one) { return !one.has_number(); };
  auto next = all ? unstored_.begin() : std::ranges::find_if(unstored_, has_none);
  while (next != unstored_.end()) {
    const auto sequence = store_.append(ground_link::to_bytes(next->report));
    if (!sequence.ok()) {
      store_trouble_ = sequence.error().message;
      while (unstored_.size() > kMostUnstored) {
        unstored_.pop_front();
        ++dropped_;
      }
      return;
    }
    outbox_.stored(sequence.value());
    next = unstored_.erase(next);
  }
  const auto dropped = outbox_.limit(settings_.store_limit);
  dropped_ += dropped.size();
  if (dropped.empty()) return;
  std::ranges::copy(dropped, std::back_inserter(delivered_));  // to be removed as those are
  remove_delivered();
}

void GroundLink::publish() {
  publish_trouble_.clear();               // unless it is met again
  for (int part = 0; part < 2; ++part) {  // up to what has a number in memory, and beyond
    publish_stored();
    publish_unstored();
  }
}

std::string GroundLink::broker() const {
  return settings_.mqtt.host + ":" + std::to_string(settings_.mqtt.port);
}

std::chrono::nanoseconds GroundLink::pause() const {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(settings_.mqtt.longest_retry_s));
}

std::optional<int> GroundLink::give(ground_link::GroundReport report, uint64_t stream, uint64_t sequence) {
  report.stream = stream;
  report.sequence = sequence;
  const auto id = client_->publish(settings_.topic, ground_link::to_bytes(report));
  if (id.ok()) return id.value();
  publish_trouble_ = "a report cannot be given to " + broker() + " (" + id.error().message + ")";
  return std::nullopt;
}

void GroundLink::publish_unstored() {
  while (!unstored_.empty() && outbox_.takes_unstored(unstored_.front().behind)) {
    auto& [report, behind] = unstored_.front();
    const uint64_t sequence = report.sequence != 0 ? report.sequence : memory_sequence_ + 1;
    const auto id = give(report, memory_stream_, sequence);
    if (!id) return;
    memory_sequence_ = std::max(memory_sequence_, sequence);
    report.sequence = sequence;
    behind = std::min(behind, outbox_.newest());
    outbox_.published_unstored(*id);
    unstored_under_way_.insert_or_assign(*id, std::move(unstored_.front()));
    unstored_.pop_front();
  }
}

// Those behind it wait, too: the ground gets them in order. Where the disk stays broken every next one is given up at
// once.
bool GroundLink::waits_to_read(const core::Error& error) {
  if (!unreadable_since_) unreadable_since_ = Clock::now();
  if (Clock::now() - *unreadable_since_ >= settings_.read_patience) return false;
  read_trouble_ = error.message;
  return true;
}

void GroundLink::publish_stored() {
  read_trouble_.clear();
  const uint64_t last = unstored_.empty() ? UINT64_MAX : unstored_.front().behind;
  for (auto sequence = outbox_.next(); sequence && *sequence <= last; sequence = outbox_.next()) {
    const auto bytes = store_.read(*sequence);
    if (!bytes.ok() && waits_to_read(bytes.error())) return;
    if (bytes.ok()) unreadable_since_.reset();
    const auto report = bytes.ok() && bytes.value() ? ground_link::ground_report_from(*bytes.value())
                                                    : core::Result<ground_link::GroundReport>(core::Error{"damaged"});
    if (!report.ok()) {  // it stays in the store: a new start tries it again
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
  const auto& own_trouble = link_trouble_.empty() ? publish_trouble_ : link_trouble_;
  if (const auto& trouble = own_trouble.empty() ? refusal_ : own_trouble; !trouble.empty()) {
    sentence = "Ground link: " + trouble + "; " + std::to_string(outbox_.size() + unstored_.size()) + " reports wait.";
  }
  if (dropped_ > 0)
    sentence += (sentence.empty() ? "" : " ") + std::to_string(dropped_) + " reports for the ground are lost.";
  const size_t in_memory = unstored_.size() + unstored_under_way_.size();
  std::string storing;
  if (!store_trouble_.empty()) {
    storing = store_trouble_ + " Reports go from memory: " + std::to_string(in_memory) +
              " wait there, and a power cut would lose them.";
  } else if (in_memory > 0) {
    storing = "The store works again; " + std::to_string(in_memory) +
              " reports of before wait in memory, and a power cut would lose them.";
  }
  const std::string reading =
      read_trouble_.empty() ? "" : read_trouble_ + " Stored reports wait until they can be read again.";
  for (const auto& trouble : {storing, reading, store_.problem()}) {
    if (!trouble.empty()) sentence += (sentence.empty() ? "" : " ") + trouble;
  }
  const std::lock_guard lock(mutex_);
  trouble_ = sentence;
  connected_ = own_trouble.empty() && refusal_.empty();
  stores_ = storing.empty();
}

}  // namespace railfix::tpr_publisher
