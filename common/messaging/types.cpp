#include <algorithm>
#include <cstring>
#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <mutex>

#include "core/time.hpp"
#include "idl/cameraPubSubTypes.h"
#include "idl/chargePubSubTypes.h"
#include "idl/odometryPubSubTypes.h"
#include "idl/onboardPubSubTypes.h"
#include "idl/operationPubSubTypes.h"
#include "idl/posePubSubTypes.h"
#include "idl/positionPubSubTypes.h"
#include "idl/recorderPubSubTypes.h"
#include "idl/sensorsPubSubTypes.h"
#include "idl/trackPubSubTypes.h"
#include "messaging/charge_topic.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;

template <class T>
void copy_sample(const T& from, T& to) {
  to = from;
}

// A picture's array is as long as the largest picture; only the pixels in use are copied.
void copy_sample(const msg::CameraFrame& from, msg::CameraFrame& to) {
  to.stamp_ns(from.stamp_ns());
  to.grabbed_ns(from.grabbed_ns());
  to.seq(from.seq());
  to.width_px(from.width_px());
  to.height_px(from.height_px());
  to.exposure_s(from.exposure_s());
  to.health(from.health());
  const size_t bytes = std::min<size_t>(static_cast<size_t>(from.width_px()) * from.height_px(), from.data().size());
  std::memcpy(to.data().data(), from.data().data(), bytes);
}

// Samples come back here when the last handler has let go of them, so that pictures need no allocation in steady state.
template <class T>
class Pool : public std::enable_shared_from_this<Pool<T>> {
 public:
  std::shared_ptr<T> get() {
    std::unique_ptr<T> sample;
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        sample = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!sample) sample = std::make_unique<T>();
    return {sample.release(), [pool = this->shared_from_this()](T* returned) { pool->put(returned); }};
  }

 private:
  static constexpr size_t kKept = 64;
  void put(T* returned) {
    std::unique_ptr<T> sample(returned);
    const std::lock_guard lock(mutex_);
    if (free_.size() < kKept) free_.push_back(std::move(sample));
  }
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> free_;
};

// The generated getKey() works in memory of the type support, which the writers and readers of a participant share. Two
// of their threads in it at once give a sample a key that nobody has, and under it stays in the history for ever.
template <class PubSub>
class OneKeyAtATime final : public PubSub {
 public:
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5) override {
    const std::lock_guard lock(mutex_);
    return PubSub::getKey(data, handle, force_md5);
  }

 private:
  std::mutex mutex_;
};

template <class T, class PubSub>
class TypeOf final : public FastDdsType {
 public:
  [[nodiscard]] std::string name() const override { return PubSub().getName(); }
  [[nodiscard]] bool keyed() const override { return PubSub().m_isGetKeyDefined; }
  [[nodiscard]] dds::TypeSupport support() const override { return dds::TypeSupport(new OneKeyAtATime<PubSub>()); }
  [[nodiscard]] std::shared_ptr<void> make() const override { return std::make_shared<T>(); }

  [[nodiscard]] std::vector<uint8_t> serialize(const void* sample) const override {
    PubSub support;
    auto* data = const_cast<void*>(sample);  // Fast DDS takes void* and only reads
    eprosima::fastrtps::rtps::SerializedPayload_t payload(support.getSerializedSizeProvider(data)());
    if (!support.serialize(data, &payload)) return {};
    return {payload.data, payload.data + payload.length};
  }

  bool deserialize(const std::vector<uint8_t>& cdr, void* sample) const override {
    if (cdr.size() < 4) return false;
    PubSub support;
    // Only read, and not the payload's own.
    eprosima::fastrtps::rtps::SerializedPayload_t payload;
    payload.data = const_cast<uint8_t*>(cdr.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    payload.length = payload.max_size = static_cast<uint32_t>(cdr.size());
    bool whole = false;
    try {
      whole = support.deserialize(&payload, sample);
    } catch (const std::exception&) {
    }
    payload.data = nullptr;
    return whole;
  }

  void take_all(dds::DataReader& reader, const OnSample& on_sample) const override {
    dds::LoanableSequence<T> samples;
    dds::SampleInfoSeq infos;
    while (reader.take(samples, infos) == ReturnCode_t::RETCODE_OK) {
      for (int32_t i = 0; i < infos.length(); ++i) {
        if (!infos[i].valid_data) continue;
        SampleInfo info;
        info.source_ns = infos[i].source_timestamp.to_ns();
        info.received_ns = infos[i].reception_timestamp.to_ns();
        info.arrived_ns = core::monotonic_ns();
        info.sequence = infos[i].sample_identity.sequence_number().to64long();
        info.writer = number_of(infos[i].sample_identity.writer_guid());
        auto copy = pool_->get();
        copy_sample(samples[i], *copy);
        on_sample(std::move(copy), info);
      }
      reader.return_loan(samples, infos);
    }
  }

 private:
  std::shared_ptr<Pool<T>> pool_ = std::make_shared<Pool<T>>();
};

}  // namespace

#define RAILFIX_TYPE(NAME)                                      \
  template <>                                                   \
  const Type& type_of<msg::NAME>() {                            \
    static const TypeOf<msg::NAME, msg::NAME##PubSubType> type; \
    return type;                                                \
  }
RAILFIX_TYPE(CameraFrame)
RAILFIX_TYPE(CameraPreview)
RAILFIX_TYPE(CameraCalibration)
RAILFIX_TYPE(ImuSample)
RAILFIX_TYPE(WheelSample)
RAILFIX_TYPE(GnssFix)
RAILFIX_TYPE(TrackView)
RAILFIX_TYPE(LandmarkSighting)
RAILFIX_TYPE(OdometryStep)
RAILFIX_TYPE(PositionFix)
RAILFIX_TYPE(TrainState)
RAILFIX_TYPE(TrainPose)
RAILFIX_TYPE(TrainPositionReport)
RAILFIX_TYPE(OnboardStatus)
RAILFIX_TYPE(ServiceStatus)
RAILFIX_TYPE(LogRecord)
RAILFIX_TYPE(RecorderStatus)
RAILFIX_TYPE(PlayerStatus)
RAILFIX_TYPE(ControlRequest)
RAILFIX_TYPE(ControlReply)
RAILFIX_TYPE(DataClock)
RAILFIX_TYPE(DataProgress)
RAILFIX_TYPE(InCharge)
#undef RAILFIX_TYPE

}  // namespace railfix::messaging
