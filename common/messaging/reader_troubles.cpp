#include "messaging/reader_troubles.hpp"

#include "messaging/participant.hpp"

namespace railfix::messaging {

namespace dds = eprosima::fastdds::dds;

std::map<std::string, ReaderTroubles> reader_troubles(Participant& participant) {
  auto& inside = participant.impl();
  const std::lock_guard lock(inside.own_mutex);
  std::map<std::string, ReaderTroubles> by_topic;
  for (auto* reader : inside.readers) {
    ReaderTroubles& troubles = by_topic[reader->get_topicdescription()->get_name()];
    dds::SampleRejectedStatus rejected;
    if (reader->get_sample_rejected_status(rejected) == ReturnCode_t::RETCODE_OK) {
      troubles.rejected += static_cast<uint64_t>(rejected.total_count);
    }
    dds::RequestedDeadlineMissedStatus missed;
    if (reader->get_requested_deadline_missed_status(missed) == ReturnCode_t::RETCODE_OK) {
      troubles.deadlines_missed += missed.total_count;
    }
  }
  return by_topic;
}

}  // namespace railfix::messaging
