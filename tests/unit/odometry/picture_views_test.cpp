#include "odometry/picture_views.hpp"

#include <gmock/gmock.h>

#include <optional>

namespace railfix::odometry {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

struct Picture {
  uint64_t frame_seq = 0;
  int64_t stamp_ns = 0;
  int64_t until_ns = 1'000'000;
};
struct View {
  uint64_t seq = 0;
  int64_t ns = 0;
  [[nodiscard]] uint64_t frame_seq() const { return seq; }
  [[nodiscard]] int64_t stamp_ns() const { return ns; }
};

class Views : public ::testing::Test {
 protected:
  PictureViews<Picture, View> views{[this](const Picture& picture, const View* view) {
    measured.emplace_back(picture.stamp_ns, view == nullptr ? std::nullopt : std::optional(view->ns));
  }};
  std::vector<std::pair<int64_t, std::optional<int64_t>>> measured;  // picture, view
};

TEST_F(Views, EachPictureGetsItsOwn) {
  views.add({1, 100});
  views.hear({1, 100});
  views.hear({2, 200});  // overtakes its picture
  views.add({2, 200});
  views.add({3, 300});  // its view is lost
  views.add({4, 400});
  views.hear({4, 400});
  views.hear({3, 300});  // or comes too late
  EXPECT_THAT(measured, ElementsAre(Pair(100, 100), Pair(200, 200), Pair(300, std::nullopt), Pair(400, 400)));
}

TEST_F(Views, PicturesDoNotWaitForever) {
  views.add({1, 100, 50});
  views.add({2, 200, 60});
  views.expire(55);
  EXPECT_THAT(measured, ElementsAre(Pair(100, std::nullopt)));
  for (uint64_t i = 3; i < 20; ++i) views.add({i, static_cast<int64_t>(i) * 100});
  views.expire(0);
  EXPECT_EQ(measured.size(), 19U - 8U);
}

// frame_grabber begins to count again; track_detector still has views of pictures that never came here.
TEST_F(Views, OfABeforeThatCountedHigherAreNobodysOwn) {
  views.add({900, 9000});
  views.hear({900, 9000});
  views.hear({901, 9100});
  views.hear({902, 9200});
  measured.clear();
  views.add({1, 20000});
  views.hear({903, 9300});  // still under way
  views.hear({1, 20000});
  views.hear({2, 20100});  // early
  views.add({2, 20100});
  EXPECT_THAT(measured, ElementsAre(Pair(20000, 20000), Pair(20100, 20100)));
  measured.clear();
  for (uint64_t seq = 3; seq <= 910; ++seq) views.add({seq, 20000 + static_cast<int64_t>(seq) * 100});
  views.expire(2'000'000);
  EXPECT_EQ(measured.size(), 908U);
  for (const auto& [picture, view] : measured) EXPECT_EQ(view, std::nullopt) << picture;
}

TEST_F(Views, AClockThatIsSetBackCostsNoMoreThanAFewViews) {
  views.add({1, 9000});
  views.hear({2, 9100});  // its picture is lost
  views.add({3, 500});
  views.hear({3, 500});
  views.add({4, 600});
  views.hear({4, 600});
  views.hear({5, 700});
  views.add({5, 700});
  EXPECT_THAT(measured, ElementsAre(Pair(9000, std::nullopt), Pair(500, 500), Pair(600, 600), Pair(700, 700)));
}

}  // namespace
}  // namespace railfix::odometry
