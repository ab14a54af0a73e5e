#include "sensor_gateway/ubx_readings.hpp"

#include <algorithm>
#include <cstdlib>
#include <numbers>
#include <utility>

#include "core/time.hpp"
#include "core/train_limits.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr uint8_t kSync[] = {0xB5, 0x62};
constexpr size_t kHead = 6;               // sync, class, id, length
constexpr size_t kAround = kHead + 2;     // and the checksum
constexpr size_t kLongestPayload = 4096;  // longer ones are taken for garbage: a wrong length must not hold up the line
constexpr size_t kLongestMeas = 136;      // 31 measurements, and the tag of a calibration
constexpr uint8_t kEsf = 0x10;
constexpr uint8_t kMeas = 0x02;
constexpr size_t kMeasHead = 8;
constexpr uint32_t kCalibTagValid = 1U << 3U;
constexpr uint32_t kBackward = 1U << 23U;
constexpr uint32_t kTicks = kBackward - 1;
constexpr int64_t kNsPerMs = 1'000'000;
constexpr int64_t kTogetherNs = 20 * kNsPerMs;  // rates and accelerations of one sample, of two messages
constexpr uint64_t kBrokenLine = 3;             // frames in a row
constexpr int64_t kSameClockNs = core::kNsPerSecond;
constexpr double kRpsPerBit = std::numbers::pi / 180 / 4096;  // 2^-12 deg/s
constexpr double kMps2PerBit = 1.0 / 1024;

enum DataType : uint8_t { kGyroZ = 5, kTick = 10, kGyroY = 13, kGyroX = 14, kAccelX = 16, kAccelY = 17, kAccelZ = 18 };

uint32_t little(std::span<const uint8_t> bytes, size_t at, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value |= static_cast<uint32_t>(bytes[at + i]) << 8U * i;
  return value;
}

int32_t signed24(uint32_t data) {
  return static_cast<int32_t>(data << 8U) >> 8;
}

/// Of the frame with this head; nothing when no frame has such a one.
std::optional<size_t> size_of_frame(std::span<const uint8_t> head) {
  const size_t length = little(head, 4, 2);
  const size_t longest = head[2] == kEsf && head[3] == kMeas ? kLongestMeas : kLongestPayload;
  return length <= longest ? std::optional(length + kAround) : std::nullopt;
}

bool checksum_holds(std::span<const uint8_t> frame) {
  uint8_t a = 0;
  uint8_t b = 0;
  for (const uint8_t byte : frame.subspan(2, frame.size() - 4)) {
    a = static_cast<uint8_t>(a + byte);
    b = static_cast<uint8_t>(b + a);
  }
  return a == frame[frame.size() - 2] && b == frame[frame.size() - 1];
}

bool is_whole_frame(std::span<const uint8_t> bytes) {
  if (bytes.size() < kHead || bytes[0] != kSync[0] || bytes[1] != kSync[1]) return false;
  const auto size = size_of_frame(bytes);
  return size && *size <= bytes.size() && checksum_holds(bytes.first(*size));
}

/// Where behind its first byte a whole frame begins; 0 = nowhere.
size_t whole_frame_within(std::span<const uint8_t> bytes) {
  for (size_t at = 1; at < bytes.size(); ++at) {
    at = static_cast<size_t>(std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(), kSync[0]) -
                             bytes.begin());
    if (is_whole_frame(bytes.subspan(at))) return at;
  }
  return 0;
}

/// Index in UbxReadings::axes_; nothing for what is no axis.
std::optional<size_t> axis_of(uint32_t type) {
  constexpr DataType kAxes[] = {kGyroX, kGyroY, kGyroZ, kAccelX, kAccelY, kAccelZ};
  const auto* const found = std::find(std::begin(kAxes), std::end(kAxes), type);
  if (found == std::end(kAxes)) return std::nullopt;
  return static_cast<size_t>(found - std::begin(kAxes));
}

}  // namespace

int64_t UbxReadings::Tag::ns(uint32_t tag_ms) {
  // One that was set back goes back: the difference of two counters of 32 bits.
  const int64_t step_ms = last_ms_ ? static_cast<int32_t>(tag_ms - *last_ms_) : int64_t{tag_ms};
  last_ms_ = tag_ms;
  ns_ += step_ms * kNsPerMs;
  return ns_;
}

void UbxReadings::connected() {
  pending_.clear();
  axes_ = {};
  periods_ns_.fill(2 * kTogetherNs);
  has_bytes_ = has_frames_ = has_measurements_ = false;
  broken_in_a_row_ = 0;
}

std::vector<Sample> UbxReadings::read(std::span<const uint8_t> bytes, int64_t arrival_ns) {
  std::vector<Sample> samples;
  has_bytes_ = has_bytes_ || !bytes.empty();
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  size_t done = 0;
  while (const size_t used = read_frame(std::span(pending_).subspan(done), arrival_ns, samples)) done += used;
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(done));
  return samples;
}

/// How many bytes are dealt with; 0 = more must come. Behind a frame that is none it goes on with its second byte, or
/// with the whole frame within it: it has a wrong length, and what it lacks would be waited for.
size_t UbxReadings::read_frame(std::span<const uint8_t> bytes, int64_t arrival_ns, std::vector<Sample>& samples) {
  const auto begin = std::find(bytes.begin(), bytes.end(), kSync[0]);
  if (begin != bytes.begin()) return static_cast<size_t>(begin - bytes.begin());
  if (bytes.size() < 2) return 0;
  if (bytes[1] != kSync[1]) return 1;
  if (bytes.size() < kHead) return 0;
  const auto size = size_of_frame(bytes);
  if (!size) return broken(1);
  const auto frame = bytes.first(std::min(*size, bytes.size()));
  if (const size_t within = whole_frame_within(frame); within > 0) return broken(within);
  if (frame.size() < *size) return 0;
  if (!checksum_holds(frame)) return broken(1);
  ++frames_.whole;
  broken_in_a_row_ = 0;
  has_frames_ = true;
  if (frame[2] == kEsf && frame[3] == kMeas)
    read_measurements(frame.subspan(kHead, *size - kAround), arrival_ns, samples);
  return frame.size();
}

size_t UbxReadings::broken(size_t bytes) {
  ++frames_.broken;
  ++broken_in_a_row_;
  return bytes;
}

Frames UbxReadings::take_frames() {
  return std::exchange(frames_, {});
}

void UbxReadings::read_measurements(std::span<const uint8_t> payload, int64_t arrival_ns,
                                    std::vector<Sample>& samples) {
  if (payload.size() < kMeasHead) return;
  const uint32_t tag_ms = little(payload, 0, 4);
  const uint32_t flags = little(payload, 4, 2);
  const size_t behind = (flags & kCalibTagValid) != 0 ? 4 : 0;
  size_t count = flags >> 11U & 0x1FU;  // 0: as many as there is room for
  if (count == 0 && payload.size() >= kMeasHead + behind) count = (payload.size() - kMeasHead - behind) / 4;
  if (kMeasHead + 4 * count > payload.size()) return;
  std::optional<int64_t> imu_ns;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t data = little(payload, kMeasHead + 4 * i, 4);
    const uint32_t type = data >> 24U & 0x3FU;
    if (type == kTick) {
      has_measurements_ = true;
      add_wheel(data, {data & kTicks, tag_ms, wheel_tag_.ns(tag_ms), arrival_ns}, samples);
    } else if (const auto axis = axis_of(type)) {
      has_measurements_ = true;
      if (!imu_ns) imu_ns = imu_tag_.ns(tag_ms);
      set_axis(axes_[*axis], {signed24(data) * (*axis < 3 ? kRpsPerBit : kMps2PerBit), *imu_ns, true});
    }
  }
  if (imu_ns) add_imu(*imu_ns, samples);
}

void UbxReadings::set_axis(Axis& axis, const Axis& now) {
  const int64_t period_ns = now.tag_ns - axis.tag_ns;
  if (axis.tag_ns != 0 && period_ns > 0) periods_ns_[next_period_++ % periods_ns_.size()] = period_ns;
  axis = now;
}

// Nearer than half its period is only what belongs to the same sample. The shortest, as a lost message makes one
// longer; of the last ones, as a single odd tag would part what belongs together for ever.
int64_t UbxReadings::together_ns() const {
  return std::min(kTogetherNs, *std::min_element(periods_ns_.begin(), periods_ns_.end()) / 2);
}

// Rates and accelerations come in one message or in two. What another message's loss has left alone is no part of a
// later sample: one pair that is apart would make all behind it so.
void UbxReadings::add_imu(int64_t tag_ns, std::vector<Sample>& samples) {
  const int64_t together_ns = this->together_ns();
  for (auto& axis : axes_) axis.fresh = axis.fresh && std::abs(tag_ns - axis.tag_ns) <= together_ns;
  const bool complete = std::all_of(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.fresh; });
  if (!complete || tag_ns == last_imu_ns_) return;
  last_imu_ns_ = tag_ns;
  dataset::ImuRow row;
  row.stamp_ns = tag_ns;
  for (size_t i = 0; i < 3; ++i) {
    row.rate_rps[i] = axes_[i].value;
    row.accel_mps2[i] = axes_[3 + i].value;
  }
  for (auto& axis : axes_) axis.fresh = false;
  samples.emplace_back(row);
}

// While the line was cut or this process held up it counted on, unless it was switched off: then its time did not go on
// as ours did, and is no longer than we have waited. After a long cut the counter may have gone round.
bool UbxReadings::counted_on(const Count& count, uint32_t ticks) const {
  const int64_t ran_ns = count.tag_ns - last_count_->tag_ns;
  const int64_t waited_ns = count.arrival_ns - last_count_->arrival_ns;
  const bool as_ours = std::abs(waited_ns - ran_ns) < kSameClockNs;
  const bool late = ran_ns > 0 && count.tag_ms * kNsPerMs > waited_ns + kSameClockNs;
  const bool went_round = core::kFastestTrainMps * pulses_per_metre_ * core::seconds(ran_ns) > 0.5 * kTicks;
  return ticks < kTicks / 2 && (as_ours || late) && !went_round;
}

// The receiver counts up whichever way the train goes, and says which way that is.
void UbxReadings::add_wheel(uint32_t data, const Count& count, std::vector<Sample>& samples) {
  if (last_count_) {
    if (count.tag_ns == last_count_->tag_ns) return;
    const uint32_t ticks = (count.ticks - last_count_->ticks) & kTicks;
    const int64_t moved = (data & kBackward) != 0 ? -int64_t{ticks} : int64_t{ticks};
    pulses_ += counted_on(count, ticks) ? moved : kLeap;
  }
  last_count_ = count;
  samples.emplace_back(dataset::WheelRow{count.tag_ns, pulses_});
}

std::string UbxReadings::why_silent() const {
  if (!has_bytes_)
    return "sends nothing; check its power and the cable, and with `fuser` that no other program reads it";
  if (!has_frames_) return "sends what is no UBX; see that live.baud is the receiver's, and that UBX is switched on";
  if (broken_in_a_row_ >= kBrokenLine)
    return "sends only broken messages; check its cable, and that live.baud is the receiver's";
  if (!has_measurements_) return "sends no measurements; switch on its message UBX-ESF-MEAS (10 02)";
  return "sends no measurements any more, only other messages; switch it off and on";
}

}  // namespace railfix::sensor_gateway
