// What the ground link says of itself, for service_status and log.
#include "tpr_publisher/ground_link/ground_link.hpp"

namespace railfix::tpr_publisher {

namespace {

std::string one_after_the_other(const std::vector<std::string>& sentences) {
  std::string text;
  for (const auto& sentence : sentences) {
    if (!sentence.empty()) text += (text.empty() ? "" : " ") + sentence;
  }
  return text;
}

}  // namespace

std::string GroundLink::only_311() const {
  return "Ground link: the broker " + broker() +
         " knows only MQTT 3.1.1, which confirms what its list of rights refuses and what nobody there waits for: such "
         "reports are lost unseen. Look on the ground with railfix tpr listen whether they come.";
}

std::string GroundLink::nobody_listens() const {
  return "nobody on the ground has subscribed to " + settings_.topic + " at " + broker() +
         "; start who listens there (as railfix tpr listen)";
}

std::string GroundLink::refused_because(const ground_link::MqttRefusal& refusal) const {
  const std::string user = settings_.mqtt.user.empty() ? "a client without a user name" : "user " + settings_.mqtt.user;
  return "the broker " + broker() + " refuses what " + user + " writes to " + settings_.topic + " (" + refusal.why +
         (refusal.not_authorised ? "); let it write there in the broker's list of rights (acl_file)"
                                 : "); the broker's log and limits say more");
}

std::string GroundLink::own_trouble() const {
  const auto of_reports = trouble_with_reports();
  if (!link_trouble_.empty()) return link_trouble_;
  if (doubt_.empty()) return of_reports;
  return (of_reports.empty() ? "connected to " + broker() + " again, but " : of_reports + "; ") + doubt_;
}

std::string GroundLink::trouble_with_reports() const {
  if (!publish_trouble_.empty()) return publish_trouble_;
  if (!silent_since_) return refusal_;
  const auto silent_s = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - *silent_since_).count();
  return "the broker " + broker() + " has confirmed nothing for " + std::to_string(silent_s) + " s";
}

std::string GroundLink::storing_trouble() const {
  const size_t in_memory = unstored_.size() + unstored_under_way_.size();
  if (!store_ && Clock::now() < memory_goes_at_) {
    return store_trouble_ + " Reports wait up to " + std::to_string(settings_.read_patience.count()) +
           " s for those that may lie in it: " + std::to_string(in_memory) +
           " wait in memory, and a power cut would lose them.";
  }
  if (!store_trouble_.empty()) {
    return store_trouble_ + " Reports go from memory: " + std::to_string(in_memory) +
           " wait there, and a power cut would lose them.";
  }
  if (in_memory == 0) return "";
  return "The store works again; " + std::to_string(in_memory) +
         " reports of before wait in memory, and a power cut would lose them.";
}

void GroundLink::say() {
  std::string link = own_trouble();
  const bool connected = link.empty();
  if (!connected) {
    link = "Ground link: " + link + "; " + std::to_string(outbox_.size() + unstored_.size()) + " reports wait.";
  }
  const std::string lost = dropped_ == 0 ? "" : std::to_string(dropped_) + " reports for the ground are lost.";
  const std::string storing = storing_trouble();
  const std::string reading =
      read_trouble_.empty() ? "" : read_trouble_ + " Stored reports wait until they can be read again.";
  const auto text = one_after_the_other({link, lost, storing, reading, store_ ? store_->problem() : ""});
  const auto remark = one_after_the_other({version_remark_, store_ ? store_->remark() : ""});
  const std::lock_guard lock(mutex_);
  trouble_ = text;
  remark_ = remark;
  connected_ = connected;
  stores_ = storing.empty();
}

}  // namespace railfix::tpr_publisher
