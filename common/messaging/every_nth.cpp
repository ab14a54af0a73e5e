#include "messaging/every_nth.hpp"

#include <cstdlib>

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

// Fast DDS's two interfaces have destructors that are not virtual; nobody deletes through them.
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"

class EveryNth final : public dds::IContentFilter {
 public:
  explicit EveryNth(uint64_t n) : n_(n) {}
  bool evaluate(const SerializedPayload&, const FilterSampleInfo& info, const GUID_t&) const override {
    return info.sample_identity.sequence_number().to64long() % n_ == 0;
  }

 private:
  uint64_t n_;
};

class EveryNthFilters final : public dds::IContentFilterFactory {
 public:
  // The parameter comes from another process: what is no number lets everything pass.
  ReturnCode_t create_content_filter(const char*, const char*, const dds::TopicDataType*, const char*,
                                     const ParameterSeq& parameters, dds::IContentFilter*& filter) override {
    const uint64_t n = parameters.length() > 0 ? std::strtoull(parameters[0], nullptr, 10) : 0;
    delete static_cast<EveryNth*>(filter);
    filter = new EveryNth(n == 0 ? 1 : n);
    return ReturnCode_t::RETCODE_OK;
  }
  ReturnCode_t delete_content_filter(const char*, dds::IContentFilter* filter) override {
    delete static_cast<EveryNth*>(filter);
    return ReturnCode_t::RETCODE_OK;
  }
};

}  // namespace

dds::IContentFilterFactory& every_nth_filters() {
  static EveryNthFilters filters;
  return filters;
}

}  // namespace railfix::messaging
