#include "monitor/train_watch.hpp"

#include <algorithm>

#include "cdr/types.hpp"
#include "core/time.hpp"

namespace railfix::monitor {
namespace {

constexpr size_t kWaiting = 4000;
constexpr int kMostAtOnce = 20000;

bool of_fixed_size(const cdr::Structure& structure) {
  return std::ranges::all_of(structure.members, [](const cdr::Member& member) {
    if (member.type.kind == cdr::Kind::structure) return of_fixed_size(*member.type.structure);
    return member.type.kind != cdr::Kind::text && member.type.kind != cdr::Kind::sequence;
  });
}

}  // namespace

void TrainWatch::read(const std::set<std::string>& names) {
  for (auto& [name, topic] : topics_) {
    if (topic.reader && !names.contains(name)) topic.reader.reset();
  }
  for (const std::string& name : names) {
    const auto* info = messaging::find_topic(name);
    if (info == nullptr) continue;
    Topic& topic = topics_[name];
    if (topic.reader) continue;
    topic.statistics = TopicStatistics(info->qos.exclusive);
    topic.info = info;
    messaging::TopicInfo lenient = *info;
    // Statuses come again before anyone has missed one; asking for one again would cost an answer to each.
    if (info->name == messaging::topics::service_status.name) lenient.qos.transient_local = false;
    if (!lenient.qos.transient_local) lenient.qos.reliable = false;
    topic.before = BeforeListening(lenient.qos.transient_local, core::monotonic_ns());
    lenient.reader_queue = std::max(info->reader_queue, info->name == "camera_preview" ? size_t{4} : kWaiting);
    const size_t slash = name.find('/');
    topic.reader = std::make_unique<messaging::AnyReader>(
        participant_, lenient, slash == std::string::npos ? "" : name.substr(slash + 1), queue_,
        [this, &topic, name](const auto& sample, const auto& sample_info) {
          arrived(name, topic, sample, sample_info);
        });
  }
}

void TrainWatch::drain() {
  for (int i = 0; i < kMostAtOnce && queue_.run_one(0); ++i) {
  }
}

void TrainWatch::arrived(const std::string& name, Topic& topic, const std::shared_ptr<const void>& sample,
                         const messaging::SampleInfo& info) {
  SeenSample seen{info.arrived_ns, info.received_ns, info.source_ns, info.sequence, info.writer, topic.fixed_bytes};
  if (!topic.before.was_sent(seen)) {
    if (seen.bytes == 0) {
      seen.bytes = topic.info->type->serialize(sample.get()).size();
      const auto* structure = cdr::own_types().find(topic.info->type->name());
      if (structure != nullptr && of_fixed_size(*structure)) topic.fixed_bytes = seen.bytes;
    }
    topic.statistics.add(seen);
  }
  handler_({name, *topic.info, sample, info});
}

}  // namespace railfix::monitor
