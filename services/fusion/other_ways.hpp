// Where switches part and join again, ways of another length lead to the track that the train is on: as long as nothing
// tells which one it came over, the train may be as far behind or ahead as they differ.
#pragma once

#include "fusion/fusion_types.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// A plain value.
class OtherWays {
 public:
  /// A track was declared late, to which others lead as well.
  void join(const Sides& otherwise) { joined_.add(otherwise); }
  /// map_matcher's last word, of a train that is so far ahead of where it has the train.
  void said(const Sides& otherwise, double off_m);
  /// Over ways that were named or joined, the train may be so far away.
  [[nodiscard]] Sides named() const;
  /// ... and where map_matcher says another place that it does not name a way to.
  [[nodiscard]] Sides held() const;
  /// Only over the way that is followed the train sees this where it is. Where another one of its kind stands just
  /// where it would be over the other way, it was that one as well.
  [[nodiscard]] bool told_apart_by(const FixInput& fix, const track::Path& path, double here_m) const;

 private:
  Sides joined_;
  Sides named_;
  Sides said_elsewhere_;
};

}  // namespace railfix::fusion
