#include "ground_link/sequence_watch.hpp"

#include <algorithm>

namespace railfix::ground_link {

namespace {

constexpr uint64_t kMostMissing = 100'000;

}  // namespace

Arrival SequenceWatch::arrived(const std::string& train, uint64_t stream, uint64_t sequence) {
  const auto [found, first] = streams_.try_emplace({train, stream});
  Stream& watch = found->second;
  if (first) {
    watch.last = sequence;
    return Arrival::fresh;
  }
  if (sequence <= watch.last) return watch.missing.erase(sequence) == 1 ? Arrival::filled : Arrival::twice;
  const uint64_t begin = std::max(watch.last + 1, sequence - std::min(sequence, kMostMissing));
  for (uint64_t missing = begin; missing < sequence; ++missing) watch.missing.insert(missing);
  while (watch.missing.size() > kMostMissing) watch.missing.erase(watch.missing.begin());
  const bool gap = sequence != watch.last + 1;
  watch.last = sequence;
  return gap ? Arrival::gap : Arrival::fresh;
}

size_t SequenceWatch::missing() const {
  size_t count = 0;
  for (const auto& [key, stream] : streams_) count += stream.missing.size();
  return count;
}

}  // namespace railfix::ground_link
