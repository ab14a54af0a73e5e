#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "messaging/fastdds_qos.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/layout.hpp"
#include "messaging/participant.hpp"
#include "messaging/shared_memory.hpp"

namespace railfix::messaging {

namespace dds = eprosima::fastdds::dds;

namespace {

const eprosima::fastrtps::Duration_t kLastWordsPatience{0, 300'000'000};

}  // namespace

// A writer always has its own listener: in 2.9.1 an offered deadline that is missed crashes otherwise
// (eProsima/Fast-DDS#3423).
struct AnyWriter::Impl : dds::DataWriterListener {
  Participant::Impl* participant = nullptr;
  TopicInfo topic;
  dds::Publisher* publisher = nullptr;
  dds::DataWriter* writer = nullptr;
  std::shared_ptr<void> scratch;  // for samples that cannot be loaned
  std::shared_ptr<SentCount> sent;
  bool in_shared_memory = false;

  bool send(void* sample);
  void* loan(dds::DataWriter::LoanInitializationKind initialization);
  void touch_shared_memory();

  ~Impl() override {
    if (writer == nullptr) return;
    {
      const std::lock_guard lock(participant->own_mutex);
      participant->writers.erase(writer);
    }
    // A service's last words (its status, its last log line) would go with their writer.
    writer->wait_for_acknowledgments(kLastWordsPatience);
    // With samples in it 2.9.1 may count for ever what a heartbeat finds missing meanwhile (RTPSWriter::deinit).
    writer->clear_history(nullptr);
    const std::lock_guard lock(*participant->discovery);
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
  // No reader has its samples filtered here: 2.9.1 changes the list of filters while a sample goes through it, and
  // crashes (eProsima/Fast-DDS#4878).
  qos.writer_resource_limits().reader_filters_allocation.maximum = 0;
  qos.user_data().data_vec(user_data_of_layout(layout_of(topic)));
  auto* dds_topic = inside.topic(topic, instance);
  const bool wants_memory = wants_shared_memory(topic, qos.data_sharing());
  if (wants_memory) {
    const auto samples = static_cast<uint64_t>(topic.qos.depth) + 1;
    expect_shared_memory(samples * fastdds(*topic.type).support()->m_typeSize, dds_topic->get_name());
  }
  impl_->writer = impl_->publisher->create_datawriter(dds_topic, qos, impl_.get(), dds::StatusMask::all());
  if (impl_->writer == nullptr) {
    throw core::BadInput("topic " + dds_topic->get_name() +
                         " cannot be written: quality of service or permissions refuse it");
  }
  // Where a profile's other settings do not go with shared memory, Fast DDS makes none and sends over the network.
  impl_->in_shared_memory = wants_memory && has_shared_memory(impl_->writer->guid());
  if (impl_->in_shared_memory) {
    take_shared_memory(impl_->writer->guid(), dds_topic->get_name());
    impl_->touch_shared_memory();
  }
  impl_->scratch = topic.type->make();
  impl_->sent = std::make_shared<SentCount>(dds_topic->get_name());
  const std::lock_guard lock(inside.own_mutex);
  inside.sent.push_back(impl_->sent);
  inside.writers.insert(impl_->writer);
}

// Nullptr when there is none.
void* AnyWriter::Impl::loan(dds::DataWriter::LoanInitializationKind initialization) {
  void* memory = nullptr;
  return writer->loan_sample(memory, initialization) == ReturnCode_t::RETCODE_OK ? memory : nullptr;
}

// Shared memory is fresh when a writer is made: else each of its first pictures would wait for hundreds of page faults.
// One sample more than may be loaned at a time lies in it; what is given back goes to the end of the row.
void AnyWriter::Impl::touch_shared_memory() {
  std::vector<void*> loans;
  const auto touched = [&] { return loan(dds::DataWriter::LoanInitializationKind::ZERO_LOAN_INITIALIZATION); };
  if (void* first = touched()) writer->discard_loan(first);
  while (loans.size() < static_cast<size_t>(topic.qos.depth)) {
    void* one = touched();
    if (one == nullptr) break;
    loans.push_back(one);
  }
  for (void* one : loans) writer->discard_loan(one);
}

// Shared memory holds one sample more than the history, so there is always some, but for this: where a reader is
// matched while a sample waits to be sent, 2.9.1 (StatefulWriter::check_acked_status) never takes that sample out of
// the history again, and no memory of what came after it becomes free.
bool AnyWriter::Impl::send(void* sample) {
  bool written = writer->write(sample);
  if (!written && in_shared_memory) {
    writer->clear_history(nullptr);
    written = writer->write(sample);
  }
  if (written) ++sent->samples;
  return written;
}

bool AnyWriter::write(const void* sample) {
  return impl_->send(const_cast<void*>(sample));  // Fast DDS takes void* and only reads
}

bool AnyWriter::write_in_place(const std::function<void(void*)>& fill) {
  void* loaned = impl_->loan(dds::DataWriter::LoanInitializationKind::NO_LOAN_INITIALIZATION);
  void* sample = loaned != nullptr ? loaned : impl_->scratch.get();
  fill(sample);
  if (impl_->send(sample)) return true;
  if (loaned != nullptr) impl_->writer->discard_loan(loaned);
  return false;
}

int AnyWriter::matched_readers() const {
  dds::PublicationMatchedStatus status;
  impl_->writer->get_publication_matched_status(status);
  return status.current_count;
}

}  // namespace railfix::messaging
