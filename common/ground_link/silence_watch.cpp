#include "ground_link/silence_watch.hpp"

namespace railfix::ground_link {

void SilenceWatch::heard(const std::string& train, int64_t now_ns) {
  trains_[train] = {now_ns, false};
}

void SilenceWatch::restart(int64_t now_ns) {
  for (auto& [name, train] : trains_) train.heard_ns = now_ns;
}

std::vector<std::string> SilenceWatch::fell_silent(int64_t now_ns) {
  std::vector<std::string> names;
  for (auto& [name, train] : trains_) {
    if (train.told || now_ns - train.heard_ns <= longest_ns_) continue;
    train.told = true;
    names.push_back(name);
  }
  return names;
}

}  // namespace railfix::ground_link
