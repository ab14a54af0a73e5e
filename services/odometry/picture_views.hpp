// Which track_view belongs to which picture. Pictures leave in the order in which they came, each with its own view or
// without one. Knows no topic and no clock.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <utility>

namespace railfix::odometry {

/// Picture: frame_seq, stamp_ns, and until_ns, the time to which it waits for its view. View: frame_seq(), stamp_ns().
/// frame_seq alone names no picture: it begins again with a frame_grabber that begins again, while views of pictures
/// before that are still under way.
template <class Picture, class View>
class PictureViews {
 public:
  /// view: nullptr = none has come, nor will one.
  using Measure = std::function<void(const Picture& picture, const View* view)>;
  explicit PictureViews(Measure measure) : measure_(std::move(measure)) {}

  void add(Picture picture) {
    const auto own = std::ranges::find_if(early_, [&](const View& view) { return belongs(view, picture); });
    newest_ns_ = picture.stamp_ns;
    waiting_.push_back(std::move(picture));
    if (own != early_.end()) {
      const View view = *own;
      hear(view);
    }
    std::erase_if(early_, [this](const View& view) { return view.stamp_ns() <= newest_ns_; });
  }

  void hear(const View& view) {
    const bool has_own = std::ranges::any_of(waiting_, [&](const Picture& picture) { return belongs(view, picture); });
    // Those before this view's picture will get no view of their own any more.
    while (!waiting_.empty() && (has_own || waiting_.front().stamp_ns < view.stamp_ns())) {
      const bool own = belongs(view, waiting_.front());
      measure_first(own ? &view : nullptr);
      if (own) return;
    }
    if (view.stamp_ns() <= newest_ns_) return;  // it comes too late
    early_.push_back(view);
    if (early_.size() > kLongestQueue) early_.pop_front();
  }

  void expire(int64_t now_ns) {
    while (!waiting_.empty() && (waiting_.front().until_ns < now_ns || waiting_.size() > kLongestQueue))
      measure_first(nullptr);
  }

  void clear() {
    waiting_.clear();
    early_.clear();
    newest_ns_ = 0;
  }

 private:
  static constexpr size_t kLongestQueue = 8;

  static bool belongs(const View& view, const Picture& picture) {
    return view.frame_seq() == picture.frame_seq && view.stamp_ns() == picture.stamp_ns;
  }
  void measure_first(const View* view) {
    const Picture picture = std::move(waiting_.front());
    waiting_.pop_front();
    measure_(picture, view);
  }

  Measure measure_;
  std::deque<Picture> waiting_;
  std::deque<View> early_;  // came before their picture
  int64_t newest_ns_ = 0;   // the last picture's
};

}  // namespace railfix::odometry
