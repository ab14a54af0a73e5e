#include "core/similar_names.hpp"

#include <gmock/gmock.h>

namespace railfix::core {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(SimilarNames, FindsWhatWasMeant) {
  const std::vector<std::string> names{"track_view", "train_state", "odometry_step", "camera_frame/cam0", "imu_sample"};
  EXPECT_THAT(similar_names("track_veiw", names), ElementsAre("track_view"));
  EXPECT_THAT(similar_names("odometry", names), ElementsAre("odometry_step"));
  EXPECT_THAT(similar_names("camera_frame/cam1", names), ElementsAre("camera_frame/cam0"));
  EXPECT_THAT(similar_names("zzzzzzzzz", names), IsEmpty());
}

TEST(SimilarNames, TellAllThatThereAreWhenNoneIsLikeIt) {
  const std::vector<std::string> keys{"count", "limit", "map", "start", "on"};
  EXPECT_EQ(did_you_mean("cuont", keys), "did you mean count?");
  EXPECT_EQ(did_you_mean("zzzz", keys), "there are: count, limit, map, start, on");
  EXPECT_EQ(did_you_mean("", keys), "there are: count, limit, map, start, on");
  EXPECT_EQ(did_you_mean("setings", {"train", "settings"}), "did you mean settings?") << "of two, too";
  EXPECT_EQ(did_you_mean("caboose", {"cab", "coach"}), "there are: cab, coach");
}

}  // namespace
}  // namespace railfix::core
