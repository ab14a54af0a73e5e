// What a service did not use of its inputs, counted by topic and reason.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

namespace railfix::service {

class LeftOut {
 public:
  static constexpr const char* kNoSense = "their values are no numbers, or such as no train has";

  void add(const std::string& topic, const std::string& why, int64_t data_ns);
  /// Of what was left out last, for ten seconds of the data's time; empty = none.
  [[nodiscard]] std::string sentence(int64_t data_ns) const;

 private:
  using TopicAndReason = std::pair<std::string, std::string>;
  std::map<TopicAndReason, uint64_t> counts_;
  TopicAndReason last_;
  int64_t last_ns_ = 0;
};

}  // namespace railfix::service
