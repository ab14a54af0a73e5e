// What a running train looks like in a terminal: position line and one line a service, redrawn in place.
#pragma once

#include <string>

#include "run/supervisor.hpp"

namespace railfix::tool {

/// The whole table as text, one line each.
std::string table_of(const TrainPicture& picture);

/// Draws the table in place on a terminal once a second; elsewhere one summary line every ten seconds.
class LiveTable {
 public:
  LiveTable();
  void update(const TrainPicture& picture);
  /// Draws the last state once more.
  void finish(const TrainPicture& picture);

 private:
  void draw(const TrainPicture& picture);
  bool terminal_;
  int64_t drawn_ns_ = 0;
  size_t drawn_lines_ = 0;
};

}  // namespace railfix::tool
