// The ground's side of "is it still there?": who has not been heard for long. A train that stands reports every
// T_CYCLOC.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace railfix::ground_link {

class SilenceWatch {
 public:
  explicit SilenceWatch(int64_t longest_ns) : longest_ns_(longest_ns) {}
  void heard(const std::string& train, int64_t now_ns);
  /// Nobody could be heard until now.
  void restart(int64_t now_ns);
  /// Trains that have been silent for longer, each once until it is heard again.
  std::vector<std::string> fell_silent(int64_t now_ns);

 private:
  struct Train {
    int64_t heard_ns = 0;
    bool told = false;
  };
  int64_t longest_ns_;
  std::map<std::string, Train> trains_;
};

}  // namespace railfix::ground_link
