#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "messaging/fastdds_qos.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/participant.hpp"

namespace railfix::messaging {

namespace dds = eprosima::fastdds::dds;

namespace {

const eprosima::fastrtps::Duration_t kLastWordsPatience{0, 300'000'000};

// A reader of an exclusive topic beside its writer: it hears whom everybody hears.
class OwnerWatch {
 public:
  OwnerWatch(Participant::Impl& participant, const TopicInfo& topic, const dds::DataWriter& writer)
      : participant_(participant), own_(writer.get_instance_handle()) {
    dds::DataReaderQos qos;
    apply(topic.qos, qos);
    qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;  // only what is said from now on
    type_ = &fastdds(*topic.type);
    reader_ = participant_.train.subscriber->create_datareader(writer.get_topic(), qos);
    if (reader_ == nullptr) throw core::BadInput("topic " + topic.name + " cannot be read: permissions refuse it");
    const std::lock_guard lock(participant_.mutex);
    participant_.readers.insert(reader_);
  }
  ~OwnerWatch() {
    {
      const std::lock_guard lock(participant_.mutex);
      participant_.readers.erase(reader_);
    }
    participant_.train.subscriber->delete_datareader(reader_);
  }
  OwnerWatch(const OwnerWatch&) = delete;
  OwnerWatch& operator=(const OwnerWatch&) = delete;

  Owner heard() {
    type_->take_all(*reader_, [this](const auto&, const SampleInfo& info, const dds::InstanceHandle_t& writer) {
      if (info.valid) heard_ = writer == own_ ? Owner::self : Owner::other;
    });
    return heard_;
  }

 private:
  Participant::Impl& participant_;
  dds::InstanceHandle_t own_;
  const FastDdsType* type_ = nullptr;
  dds::DataReader* reader_ = nullptr;
  Owner heard_ = Owner::unknown;
};

}  // namespace

// A writer always has its own listener: in 2.9.1 an offered deadline that is missed crashes otherwise
// (eProsima/Fast-DDS#3423).
struct AnyWriter::Impl : dds::DataWriterListener {
  Participant::Impl* participant = nullptr;
  TopicInfo topic;
  dds::Publisher* publisher = nullptr;
  dds::DataWriter* writer = nullptr;
  std::unique_ptr<OwnerWatch> owner_watch;
  std::shared_ptr<void> scratch;  // for topics whose samples cannot be loaned
  std::shared_ptr<SentCount> sent;

  bool send(void* sample);

  ~Impl() override {
    owner_watch.reset();
    if (writer == nullptr) return;
    {
      const std::lock_guard lock(participant->mutex);
      participant->manual_liveliness.erase(writer);
      participant->writers.erase(writer);
    }
    // A service's last words (its status, its last log line) would go with their writer.
    writer->wait_for_acknowledgments(kLastWordsPatience);
    publisher->delete_datawriter(writer);
  }
};

AnyWriter::AnyWriter(Participant& participant, const TopicInfo& topic, const std::string& instance)
    : impl_(std::make_shared<Impl>()) {
  auto& inside = participant.impl();
  impl_->participant = &inside;
  impl_->topic = topic;
  impl_->publisher = inside.ends_of(topic).publisher;
  dds::DataWriterQos qos;
  if (!inside.own_profiles ||
      impl_->publisher->get_datawriter_qos_from_profile(topic.name, qos) != ReturnCode_t::RETCODE_OK) {
    apply(topic.qos, qos);
  }
  if (topic.qos.exclusive) qos.ownership_strength().value = static_cast<uint32_t>(inside.options.ownership_strength);
  auto* dds_topic = inside.topic(topic, instance);
  impl_->writer = impl_->publisher->create_datawriter(dds_topic, qos, impl_.get(), dds::StatusMask::all());
  if (impl_->writer == nullptr) {
    throw core::BadInput("topic " + dds_topic->get_name() +
                         " cannot be written: quality of service or permissions refuse it");
  }
  impl_->scratch = topic.type->make();
  impl_->sent = std::make_shared<SentCount>(dds_topic->get_name());
  const std::lock_guard lock(inside.mutex);
  inside.sent.push_back(impl_->sent);
  inside.writers.insert(impl_->writer);
  if (topic.qos.liveliness_lease_ns > 0) inside.manual_liveliness.insert(impl_->writer);
}

bool AnyWriter::Impl::send(void* sample) {
  if (!writer->write(sample)) return false;
  ++sent->samples;
  return true;
}

bool AnyWriter::write(const void* sample) {
  return impl_->send(const_cast<void*>(sample));  // Fast DDS takes void* and only reads
}

bool AnyWriter::write_in_place(const std::function<void(void*)>& fill) {
  void* loan = nullptr;
  const auto loaned = impl_->writer->loan_sample(loan, dds::DataWriter::LoanInitializationKind::NO_LOAN_INITIALIZATION);
  if (loaned != ReturnCode_t::RETCODE_OK) {
    fill(impl_->scratch.get());
    return impl_->send(impl_->scratch.get());
  }
  fill(loan);
  if (impl_->send(loan)) return true;
  impl_->writer->discard_loan(loan);
  return false;
}

void AnyWriter::set_ownership_strength(int64_t strength) {
  auto qos = impl_->writer->get_qos();
  qos.ownership_strength().value = static_cast<uint32_t>(strength);
  impl_->writer->set_qos(qos);
}

Owner AnyWriter::owner() {
  if (!impl_->owner_watch)
    impl_->owner_watch = std::make_unique<OwnerWatch>(*impl_->participant, impl_->topic, *impl_->writer);
  return impl_->owner_watch->heard();
}

int AnyWriter::matched_readers() const {
  dds::PublicationMatchedStatus status;
  impl_->writer->get_publication_matched_status(status);
  return status.current_count;
}

}  // namespace railfix::messaging
