// Loaned and shared samples are read as they lie in memory; fastddsgen 2.3 calls types "plain" without comparing the
// layouts. So what it calls plain must be, byte by byte, what CDR makes of it.
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>

#include "idl/cameraPubSubTypes.h"
#include "idl/odometryPubSubTypes.h"
#include "idl/onboardPubSubTypes.h"
#include "idl/posePubSubTypes.h"
#include "idl/positionPubSubTypes.h"
#include "idl/sensorsPubSubTypes.h"
#include "idl/trackPubSubTypes.h"
#include "messaging/topics.hpp"

namespace railfix::msg {
namespace {

template <class PubSub, class Message>
struct Plain {
  using PubSubType = PubSub;
  using MessageType = Message;
};

template <class T>
class PlainTypes : public ::testing::Test {};

using Types =
    ::testing::Types<Plain<CameraFramePubSubType, CameraFrame>, Plain<ImuSamplePubSubType, ImuSample>,
                     Plain<WheelSamplePubSubType, WheelSample>, Plain<GnssFixPubSubType, GnssFix>,
                     Plain<TrackViewPubSubType, TrackView>, Plain<LandmarkSightingPubSubType, LandmarkSighting>,
                     Plain<OdometryStepPubSubType, OdometryStep>, Plain<PositionFixPubSubType, PositionFix>,
                     Plain<TrainStatePubSubType, TrainState>, Plain<TrainPosePubSubType, TrainPose>,
                     Plain<TrainPositionReportPubSubType, TrainPositionReport>,
                     Plain<OnboardStatusPubSubType, OnboardStatus>>;
TYPED_TEST_SUITE(PlainTypes, Types);

TYPED_TEST(PlainTypes, MemoryIsCdr) {
  using Message = typename TypeParam::MessageType;
  typename TypeParam::PubSubType type;
  EXPECT_TRUE(type.is_plain()) << type.getName()
                               << " is not plain: an enum, a string or a sequence in it ends shared memory and loans.";
  ASSERT_EQ(sizeof(Message), Message::getMaxCdrSerializedSize())
      << type.getName() << " has " << sizeof(Message) << " bytes in memory, but " << Message::getMaxCdrSerializedSize()
      << " in CDR: order its members 8, 4, 2, 1 bytes and fill it up to a multiple of 8 with `octet padding[n]`.";

  auto message = std::make_unique<Message>();
  std::vector<uint8_t> pattern(sizeof(Message));
  for (size_t i = 0; i < pattern.size(); ++i) pattern[i] = static_cast<uint8_t>(i * 151 % 251);
  std::memcpy(static_cast<void*>(message.get()), pattern.data(), pattern.size());
  const auto cdr = messaging::serialize(*message);
  constexpr size_t kEncapsulation = 4;
  ASSERT_EQ(cdr.size(), pattern.size() + kEncapsulation) << type.getName();
  EXPECT_EQ(std::memcmp(cdr.data() + kEncapsulation, pattern.data(), pattern.size()), 0)
      << type.getName() << ": members do not lie in memory where CDR puts them.";
}

TEST(PlainTypeNames, AreThoseOfTheIdl) {
  // Other vendors match topics by this name.
  EXPECT_EQ(std::string(TrainStatePubSubType().getName()), "railfix::msg::TrainState");
  EXPECT_EQ(std::string(TrainPositionReportPubSubType().getName()), "railfix::msg::TrainPositionReport");
}

}  // namespace
}  // namespace railfix::msg
