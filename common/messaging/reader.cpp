#include <fastdds/dds/subscriber/DataReaderListener.hpp>

#include "core/time.hpp"
#include "messaging/fastdds_qos.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/layout.hpp"
#include "messaging/participant.hpp"
#include "messaging/shared_memory.hpp"

namespace railfix::messaging {

namespace dds = eprosima::fastdds::dds;

namespace {

// Of two writers of an exclusive topic the one that was heard goes on being heard until it has been silent for so long:
// more than a period of train_state without a camera, less than a standby needs to take over. DDS's own exclusive
// ownership would hear the strongest, which is the one that comes back and knows nothing yet.
constexpr int64_t kHoldNs = 150'000'000;
// For the file where a writer in shared memory calls its reader: 21,656 bytes in 2.9.1.
constexpr uint64_t kCallBytes = 32'768;

class OneWriter {
 public:
  bool hears(uint64_t writer) {
    const int64_t now_ns = core::monotonic_ns();
    if (writer != writer_ && now_ns - heard_ns_ < kHoldNs) return false;
    writer_ = writer;
    heard_ns_ = now_ns;
    return true;
  }

 private:
  uint64_t writer_ = 0;
  int64_t heard_ns_ = -kHoldNs;
};

}  // namespace

struct AnyReader::Impl : dds::DataReaderListener {
  Participant::Impl* participant = nullptr;
  const FastDdsType* type = nullptr;
  dds::Subscriber* subscriber = nullptr;
  dds::DataReader* reader = nullptr;
  Queue* queue = nullptr;
  std::shared_ptr<const Handler> handler;
  Queue::Source source;
  bool exclusive = false;
  uint64_t layout = 0;
  OneWriter one_writer;                     // the middleware's thread only
  std::map<uint64_t, bool> fits_by_writer;  // the same

  // Its writer was discovered before its samples come.
  bool hears(uint64_t writer) {
    const auto known = fits_by_writer.find(writer);
    if (known != fits_by_writer.end()) return known->second;
    return fits_by_writer[writer] = fits(layout, participant->layout_of_writer(writer));
  }

  void on_data_available(dds::DataReader* from) override {
    type->take_all(*from, [this](std::shared_ptr<const void> sample, const SampleInfo& info) {
      if (!hears(info.writer)) return;
      if (exclusive && !one_writer.hears(info.writer)) return;
      queue->push(&source, [run = handler, sample = std::move(sample), info] { (*run)(sample, info); });
    });
  }
};

AnyReader::AnyReader(Participant& participant, const TopicInfo& topic, const std::string& instance, Queue& queue,
                     Handler handler)
    : impl_(std::make_unique<Impl>()) {
  auto& inside = participant.impl();
  impl_->participant = &inside;
  impl_->type = &fastdds(*topic.type);
  impl_->queue = &queue;
  impl_->handler = std::make_shared<const Handler>(std::move(handler));
  impl_->exclusive = topic.qos.exclusive;
  impl_->source.limit = topic.reader_queue;
  impl_->subscriber = inside.ends_of(topic).subscriber;
  dds::DataReaderQos qos;
  if (!inside.own_profiles ||
      impl_->subscriber->get_datareader_qos_from_profile(topic.name, qos) != ReturnCode_t::RETCODE_OK) {
    apply(topic.qos, qos);
  }
  impl_->layout = layout_of(topic);
  qos.user_data().data_vec(user_data_of_layout(impl_->layout));
  auto* source = inside.topic(topic, instance);
  if (wants_shared_memory(topic, qos.data_sharing())) expect_shared_memory(kCallBytes, source->get_name());
  impl_->reader = impl_->subscriber->create_datareader(source, qos, impl_.get(), dds::StatusMask::data_available());
  if (impl_->reader == nullptr) {
    throw core::BadInput("topic " + source->get_name() +
                         " cannot be read: quality of service or permissions refuse it");
  }
  const std::lock_guard lock(inside.own_mutex);
  inside.readers.insert(impl_->reader);
}

AnyReader::~AnyReader() {
  {
    const std::lock_guard lock(impl_->participant->own_mutex);
    impl_->participant->readers.erase(impl_->reader);
  }
  {
    const std::lock_guard lock(*impl_->participant->discovery);
    impl_->reader->set_listener(nullptr);
    impl_->subscriber->delete_datareader(impl_->reader);
  }
  impl_->queue->forget(&impl_->source);
}

int AnyReader::matched_writers() const {
  dds::SubscriptionMatchedStatus status;
  impl_->reader->get_subscription_matched_status(status);
  return status.current_count;
}

uint64_t AnyReader::dropped() const {
  return impl_->queue->dropped(impl_->source);
}

}  // namespace railfix::messaging
