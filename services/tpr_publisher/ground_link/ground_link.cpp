#include "tpr_publisher/ground_link/ground_link.hpp"

#include <algorithm>

namespace railfix::tpr_publisher {

namespace {

constexpr size_t kMostUnderWay = 20;
constexpr size_t kMostUnstored = 1000;
constexpr std::chrono::seconds kRetrySoon{1};  // of the store, and of what the client did not take
constexpr std::chrono::seconds kFarewell{2};   // for what cannot be stored at the end
constexpr int kSilentKeepAlives = 2;           // as long as it takes at most to find a broker gone

/// There may be reports of before in it: where the folder is missing, on a disk that is mounted late.
bool may_hold_reports(const std::filesystem::path& file) {
  std::error_code failed;
  const auto bytes = std::filesystem::file_size(file, failed);
  if (!failed) return bytes > 0;
  if (failed != std::errc::no_such_file_or_directory) return true;
  return file.has_parent_path() && !std::filesystem::is_directory(file.parent_path(), failed);
}

}  // namespace

GroundLink::GroundLink(const GroundLinkSettings& settings)
    : settings_(settings),
      open_again_at_(Clock::now()),
      memory_goes_at_(open_again_at_),
      outbox_(kMostUnderWay),
      stream_(ReportStore::new_stream()),
      link_trouble_("not yet connected") {
  if (may_hold_reports(settings.store)) memory_goes_at_ += settings.read_patience;
  open_store();
  say();
  client_ = std::make_unique<ground_link::MqttClient>(
      settings.mqtt, ground_link::MqttEvents{
                         .connected = [this](const Connected& now) { push(now); },
                         .disconnected = [this](const std::string& why) { push(Disconnected{why}); },
                         .delivered = [this](int id) { push(Delivered{id}); },
                         .refused =
                             [this](int id, const auto& refusal) {
                               push(Refused{id, refusal});
                             },
                         .received = {},
                         .unheard = [this](int id) { push(Unheard{id}); },
                         .lasts = [this] { push(Lasts{}); },
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
  const bool soon_again = !store_ || !unstored_.empty() || !delivered_.empty() || !read_trouble_.empty() ||
                          !publish_trouble_.empty() || !given_.empty() || silent_since_;
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
    notice_silence();
    if (!last) work(false);
  }
  say_farewell();
}

void GroundLink::work(bool store_all) {
  open_store();
  if (store_ && (!unstored_.empty() || !delivered_.empty())) store_trouble_.clear();  // unless it is met again
  remove_delivered();
  if (store_all) store_under_way();
  store_new(store_all);
  if (store_all) std::ranges::for_each(unstored_, [](Unstored& one) { one.behind = 0; });
  try_again();
  publish();
  say();
}

// What is stored goes at the next start; the rest now or never, also before what lies in a store.
void GroundLink::say_farewell() {
  const auto until = Clock::now() + kFarewell;
  memory_goes_at_ = {};
  open_again_at_ = {};
  const auto waiting = [this] { return unstored_.size() + unstored_under_way_.size(); };
  for (work(true); waiting() > 0 && Clock::now() < until; work(true)) {
    std::unique_lock lock(mutex_);
    wake_.wait_until(lock, std::min(until, Clock::now() + kRetrySoon), [this] { return !events_.empty(); });
    auto events = std::exchange(events_, {});
    lock.unlock();
    for (auto& event : events) take(event);
  }
  if (waiting() == 0 || !settings_.warn) return;
  settings_.warn(std::to_string(waiting()) + " reports for the ground are lost: at the end they could not be stored (" +
                 store_trouble_ + "), and " + broker() + " did not confirm them.");
}

void GroundLink::take(Event& event) {
  std::visit([this](auto& one) { take(one); }, event);
}

// Numbered by each start anew: a store from which a lying disk or a copy has lost the newest would give their numbers
// to other reports, which the ground took for those that it has.
void GroundLink::take(ground_link::GroundReport& report) {
  report.stream = stream_;
  report.sequence = ++sequence_;
  unstored_.push_back({std::move(report)});
}

void GroundLink::take(const Connected& now) {
  connection_ = now.number;
  link_trouble_.clear();
  doubt_ = now.doubt;
  version_remark_ = now.version == ground_link::MqttVersion::v5 ? "" : only_311();
  outbox_.connected();
}

void GroundLink::take(const Lasts& /*lasts*/) {
  doubt_.clear();
}

void GroundLink::take(const Disconnected& lost) {
  link_trouble_ = "not connected to " + broker() + " (" + lost.why + ")";
  given_.clear();
  outbox_.disconnected();
  while (!unstored_under_way_.empty()) wait_again(unstored_under_way_.begin()->first);
}

void GroundLink::take(const Delivered& report) {
  given_.erase(report.id);
  silent_since_.reset();
  unstored_under_way_.erase(report.id);
  if (const auto sequence = outbox_.delivered(report.id)) delivered_.push_back(*sequence);
  if (!outbox_.held()) refusal_.clear();
}

void GroundLink::take(const Refused& report) {
  not_taken(report.id, refused_because(report.refusal));
}

void GroundLink::take(const Unheard& report) {
  not_taken(report.id, nobody_listens());
}

void GroundLink::not_taken(int id, std::string why) {
  given_.erase(id);
  silent_since_.reset();
  if (!outbox_.held()) try_again_at_ = Clock::now() + pause();
  outbox_.refused(id);
  refusal_ = std::move(why);
  wait_again(id);
}

// Over a connection that stands nothing is repeated: a confirmation that got lost, or a broker that hangs and keeps the
// connection, would hold the reports up for ever.
void GroundLink::notice_silence() {
  if (given_.empty()) {
    if (outbox_.size() + unstored_.size() == 0) silent_since_.reset();
    return;
  }
  const auto when = [](const auto& one) { return one.second; };
  const auto oldest = when(*std::ranges::min_element(given_, {}, when));
  const std::chrono::seconds patience{kSilentKeepAlives * settings_.mqtt.keep_alive_s};
  if (Clock::now() - oldest < patience) return;
  if (!silent_since_) silent_since_ = oldest;
  client_->give_up(connection_, "it has confirmed nothing for " + std::to_string(patience.count()) + " s");
}

// Its disk may be full, read-only or not there yet: reports go from memory until then.
void GroundLink::open_store() {
  if (store_ || Clock::now() < open_again_at_) return;
  open_again_at_ = Clock::now() + kRetrySoon;
  auto opened = ReportStore::open(settings_.store);
  const auto stored = opened.ok() ? opened.value().sequences() : core::Result<std::vector<uint64_t>>(opened.error());
  if (!stored.ok()) {
    store_trouble_ = stored.error().message;
    return;
  }
  store_trouble_.clear();
  store_ = std::move(opened).value();
  for (const uint64_t sequence : stored.value()) outbox_.stored(sequence);
}

void GroundLink::wait_again(int id) {
  auto unstored = unstored_under_way_.extract(id);
  if (!unstored) return;
  const auto later = [&](const auto& one) { return one.report.sequence > unstored.mapped().report.sequence; };
  unstored_.insert(std::ranges::find_if(unstored_, later), std::move(unstored.mapped()));
}

void GroundLink::try_again() {
  if (outbox_.held() && Clock::now() >= try_again_at_) outbox_.try_again();
}

// In one go: when that is lost in a power cut they are only sent again.
void GroundLink::remove_delivered() {
  if (!store_) return;
  const auto removed = store_->remove(delivered_);
  if (removed.ok()) {
    delivered_.clear();
  } else {
    store_trouble_ = removed.error().message;
  }
}

// At the end: a later start sends it, where it may come behind what was stored since, and twice.
void GroundLink::store_under_way() {
  while (store_ && !unstored_under_way_.empty()) {
    const auto next = unstored_under_way_.begin();
    const auto stored = store_->append(ground_link::to_bytes(next->second.report));
    if (!stored.ok()) {
      store_trouble_ = stored.error().message;
      return;
    }
    unstored_under_way_.erase(next);
  }
}

// One that was given to the client goes before what is stored since, and is stored at the end at most, as above.
void GroundLink::store_new(bool all) {
  const auto is_new = [](const Unstored& one) { return !one.given; };
  auto next = all ? unstored_.begin() : std::ranges::find_if(unstored_, is_new);
  while (next != unstored_.end()) {
    const auto sequence = store_ ? store_->append(ground_link::to_bytes(next->report))
                                 : core::Result<uint64_t>(core::Error{store_trouble_});
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

std::chrono::nanoseconds GroundLink::pause() const {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(settings_.mqtt.longest_retry_s));
}

std::optional<int> GroundLink::give(const ground_link::GroundReport& report) {
  const auto id = client_->publish(settings_.topic, ground_link::to_bytes(report), connection_);
  if (!id.ok()) {
    publish_trouble_ = "a report cannot be given to " + broker() + " (" + id.error().message + ")";
    return std::nullopt;
  }
  given_[id.value()] = Clock::now();
  return id.value();
}

void GroundLink::publish_unstored() {
  if (!store_ && Clock::now() < memory_goes_at_) return;
  while (!unstored_.empty() && outbox_.takes_unstored(unstored_.front().behind)) {
    auto& next = unstored_.front();
    const auto id = give(next.report);
    if (!id) return;
    next.given = true;
    next.behind = std::min(next.behind, outbox_.newest());
    outbox_.published_unstored(*id);
    unstored_under_way_.insert_or_assign(*id, std::move(next));
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
    const auto bytes = store_->read(*sequence);
    if (!bytes.ok() && waits_to_read(bytes.error())) return;
    if (bytes.ok()) unreadable_since_.reset();
    auto report = bytes.ok() && bytes.value() ? ground_link::ground_report_from(*bytes.value())
                                              : core::Result<ground_link::GroundReport>(core::Error{"damaged"});
    if (!report.ok()) {  // it stays in the store: a new start tries it again
      ++dropped_;
      outbox_.skip();
      continue;
    }
    if (report.value().stream == 0) {  // stored by a version that numbered what it sent by the rows of the store
      report.value().stream = store_->stream();
      report.value().sequence = *sequence;
    }
    const auto id = give(report.value());
    if (!id) return;
    outbox_.published(*id);
  }
}

}  // namespace railfix::tpr_publisher
