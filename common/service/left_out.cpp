#include "service/left_out.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::service {
namespace {

constexpr double kToldS = 10;

}  // namespace

void LeftOut::add(const std::string& topic, const std::string& why, int64_t data_ns) {
  last_ = {topic, why};
  last_ns_ = data_ns;
  ++counts_[last_];
}

std::string LeftOut::sentence(int64_t data_ns) const {
  if (last_.first.empty() || std::abs(core::seconds(data_ns - last_ns_)) > kToldS) return "";
  return std::to_string(counts_.at(last_)) + " of " + last_.first + " were left out: " + last_.second;
}

}  // namespace railfix::service
