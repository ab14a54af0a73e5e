#include "map_matcher/locate/place_filter.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace railfix::map_matcher {
namespace {

constexpr float kBlockM = PlaceFilter::kBlockBins * kBinM;
constexpr float kOriginsM = 40.0F;  // from one to the next
constexpr float kOriginSigmaM = 16.0F;
constexpr float kMapSigmaM = 1.0F;    // the map's length of a block
constexpr float kDetailM = 2.0F;      // where within so much a kink lies is not known
constexpr float kLeastLookM = 10.0F;  // about the place, for how the heading changes
constexpr float kMostLookM = 60.0F;
constexpr float kBeyondM = 100.0F;     // of the end of the track
constexpr float kMostSquared = 25.0F;  // beyond it is a kink that the map does not have
constexpr double kLikelyBelow = 20.0;
constexpr double kExpectedLog = -0.75;  // of a block at the right place, and less
constexpr float kSameM = 20.0F;
constexpr float kTurnVariance = 2e-5F;      // of a block, at least about
constexpr double kStraightTurnRad = 0.012;  // in a block of track of which nothing is known
constexpr double kOnTurnRad = 0.04;
constexpr double kAnyTurnRad = 0.1;
constexpr double kMarksPerM = 0.0025;      // of one kind, where there is one
constexpr size_t kMostPlaces = 3'000'000;  // 240 MB, of 60,000 km

// Rows of the covariance's upper triangle.
enum : size_t { kGg, kGb, kGp, kGc, kBb, kBp, kBc, kPp, kPc, kCc };

}  // namespace

std::vector<PlaceFilter::Block> PlaceFilter::blocks_of(const MeasuredWay& way, size_t gone_bins) {
  std::vector<Block> blocks;
  while (taken_bins_ + kBlockBins <= gone_bins + way.size()) {
    Block block;
    double turn = 0;
    for (size_t k = 0; k < kBlockBins; ++k) {
      const MeasuredBin& bin = way[taken_bins_ - gone_bins + k];
      turn += bin.turn_rad;
      const double least = parameters_.noise_per_m * kBinM;
      block.turn_variance += bin.variance + least * least;
      for (Mark mark : bin.marks) {
        mark.along_m += kBinM * (static_cast<double>(k) - static_cast<double>(kBlockBins));
        block.marks.push_back(mark);
      }
    }
    block.turn_variance += std::pow(parameters_.curvature_share * turn, 2);
    turned_rad_ += turn;
    block.turn_rad = turn;
    block.turned_rad = turned_rad_;
    weigh_unmapped(block);
    blocks.push_back(std::move(block));
    taken_bins_ += kBlockBins;
  }
  return blocks;
}

// Straights go on or become curves, curves go on, end or change; landmarks stand beside any track.
void PlaceFilter::weigh_unmapped(const Block& block) {
  const auto normal = [](double x, double sigma) { return std::exp(-0.5 * x * x / (sigma * sigma)) / sigma; };
  const double x = block.turn_rad;
  const double any = normal(x, kAnyTurnRad);
  const double straight = normal(x, kStraightTurnRad);
  const double as_before = normal(x - last_turn_rad_, kOnTurnRad);
  const bool was_straight = std::abs(last_turn_rad_) < 2 * kStraightTurnRad;
  const double likelihood =
      was_straight ? 0.88 * straight + 0.12 * any : 0.25 * straight + 0.45 * as_before + 0.3 * any;
  const double least = std::pow(parameters_.heading_sigma_rad, 2) + kTurnVariance;
  unmapped_log_ += std::log(likelihood * std::sqrt(least));
  unmapped_log_ += static_cast<double>(block.marks.size()) * std::log(kMarksPerM / parameters_.false_per_m);
  last_turn_rad_ = x;
}

double PlaceFilter::evidence() const {
  return best_log_ - unmapped_log_ - std::log(static_cast<double>(std::max<size_t>(origins_, 1)));
}

void PlaceFilter::advance(const MeasuredWay& way, size_t gone_bins) {
  const auto blocks = blocks_of(way, gone_bins);
  if (blocks.empty() || overflowed_) return;
  if (!begun_) return begin(blocks);
  for (const Block& block : blocks) {
    next_.clear();
    for (Place& place : places_) {
      if (runs_on(place, block)) continue;
      go(place, block, -INFINITY, next_);
      place.log = -INFINITY;
    }
    std::erase_if(places_, [](const Place& place) { return place.log == -INFINITY; });
    places_.insert(places_.end(), next_.begin(), next_.end());
    if (places_.size() > kMostPlaces) overflowed_ = true;
  }
  drop_unlikely();
  join_same();
}

void PlaceFilter::begin(const std::vector<Block>& blocks) {
  begun_ = true;
  best_logs_.assign(blocks.size(), -INFINITY);
  double most = 0;
  for (const auto& edge : index_->map().edges) most += 2 * (1 + edge.alignment.length_m() / kOriginsM);
  places_.reserve(std::min(static_cast<size_t>(most), kMostPlaces));
  for (uint32_t run = 0; run < index_->runs() && !overflowed_; ++run) {
    const float length_m = index_->length_m(run);
    const float count = std::max(1.0F, std::round(length_m / kOriginsM));
    for (int i = 0; i < static_cast<int>(count); ++i)
      follow(origin_at(run, length_m * (static_cast<float>(i) + 0.5F) / count), blocks);
    origins_ += static_cast<size_t>(count);
    overflowed_ = places_.size() > kMostPlaces;
  }
  drop_unlikely();  // few have met by now
}

PlaceFilter::Place PlaceFilter::origin_at(uint32_t run, float into_m) const {
  Place place;
  place.run = run;
  place.before = NetworkIndex::kNoRun;
  place.into_m = into_m;
  place.base_rad = -index_->turned(run, into_m);
  const auto scale = static_cast<float>(parameters_.scale_range / std::sqrt(3.0));
  const auto heading = static_cast<float>(parameters_.heading_sigma_rad);
  const auto bias = static_cast<float>(parameters_.bias_per_m);
  const float curvature =
      (index_->turned(run, into_m + kLeastLookM) - index_->turned(run, into_m - kLeastLookM)) / (2 * kLeastLookM);
  const float place_variance = kOriginSigmaM * kOriginSigmaM;
  // The measured turning begins here: where the place is wrong, the heading is, too.
  auto& c = place.covariance;
  c[kGg] = heading * heading + curvature * curvature * place_variance;
  c[kGp] = -curvature * place_variance;
  c[kPp] = place_variance;
  c[kBb] = bias * bias;
  c[kCc] = scale * scale;
  return place;
}

// All blocks for one origin, as long as it is worth it.
void PlaceFilter::follow(Place origin, const std::vector<Block>& blocks) {
  const auto least_log = [&](size_t k) {
    return std::max(kExpectedLog * static_cast<double>(k + 1), best_logs_[k]) - kFarBelow;
  };
  size_t k = 0;
  for (; k < blocks.size() && runs_on(origin, blocks[k]); ++k) {
    if (origin.log < least_log(k)) return;
    best_logs_[k] = std::max(best_logs_[k], static_cast<double>(origin.log));
  }
  now_.assign(1, origin);
  for (; k < blocks.size() && !now_.empty(); ++k) {
    const double least = least_log(k);
    next_.clear();
    for (const Place& place : now_) go(place, blocks[k], least, next_);
    for (const Place& place : next_) best_logs_[k] = std::max(best_logs_[k], static_cast<double>(place.log));
    std::swap(now_, next_);
  }
  places_.insert(places_.end(), now_.begin(), now_.end());
}

// When the train has gone on by a block, but for its place.
void PlaceFilter::foretell(Place& place, const Block& block) {
  auto& c = place.covariance;
  constexpr float l = kBlockM;
  place.offset_rad += l * place.bias_per_m;
  c[kGg] += 2 * l * c[kGb] + l * l * c[kBb] + static_cast<float>(block.turn_variance);
  c[kGp] += l * (c[kGc] + c[kBp] + l * c[kBc]);
  c[kGb] += l * c[kBb];
  c[kGc] += l * c[kBc];
  c[kBp] += l * c[kBc];
  c[kPp] += 2 * l * c[kPc] + l * l * c[kCc] + kMapSigmaM * kMapSigmaM;
  c[kPc] += l * c[kCc];
}

float PlaceFilter::block_end_m(const Place& place) {
  return place.into_m + kBlockM * (1 + place.scale_error);
}

// Mostly: nothing need be copied.
bool PlaceFilter::runs_on(Place& place, const Block& block) const {
  const float to_m = block_end_m(place);
  if (to_m > index_->length_m(place.run)) return false;
  foretell(place, block);
  place.into_m = to_m;
  weigh(place, block);
  if (!block.marks.empty()) weigh_marks(place, {}, block);
  return true;
}

void PlaceFilter::go(const Place& place, const Block& block, double least_log, std::vector<Place>& to) const {
  Place foretold = place;
  foretell(foretold, block);
  go_on(foretold, block_end_m(place), {}, block, least_log, to);
}

void PlaceFilter::go_on(const Place& place, float end_m, const Trail& trail, const Block& block, double least_log,
                        std::vector<Place>& to) const {
  const float length_m = index_->length_m(place.run);
  const auto& after = index_->after(place.run);
  if (end_m > length_m && !after.empty()) {
    if (trail.size == trail.legs.size()) return;
    Trail further = trail;
    for (size_t i = 0; i < further.size; ++i) further.legs[i].begin_m -= length_m;
    further.legs[further.size++] = {place.run, -length_m};
    Place next = place;
    next.before = place.run;
    next.base_rad += index_->turned(place.run, length_m);
    for (const uint32_t run : after) {
      next.run = run;
      go_on(next, end_m - length_m, further, block, least_log, to);
    }
    return;
  }
  // The place is not known exactly: the end of the track may seem to be passed.
  if (end_m > length_m + kBeyondM) return;
  to.push_back(place);
  Place& p = to.back();
  p.into_m = std::min(end_m, length_m);
  weigh(p, block);
  if (!block.marks.empty()) weigh_marks(p, trail, block);
  if (p.log < least_log) to.pop_back();
}

/// Turned on the map since the filter's beginning, near the place.
float PlaceFilter::heading(const Place& place, float into_m) const {
  if (into_m < 0 && place.before != NetworkIndex::kNoRun) {
    const float length_m = index_->length_m(place.before);
    return place.base_rad + index_->turned(place.before, length_m + into_m) - index_->turned(place.before, length_m);
  }
  const float beyond_m = into_m - index_->length_m(place.run);
  if (beyond_m > 0 && !index_->after(place.run).empty()) {
    return place.base_rad + index_->turned(place.run, into_m - beyond_m) +
           index_->turned(index_->after(place.run).front(), beyond_m);
  }
  return place.base_rad + index_->turned(place.run, into_m);
}

// The heading is looked at as far about the place as that is unknown: what is not straight there is noise.
void PlaceFilter::weigh(Place& place, const Block& block) const {
  auto& c = place.covariance;
  const float look_m = std::clamp(std::sqrt(std::max(0.0F, c[kPp])), kLeastLookM, kMostLookM);
  const float here = heading(place, place.into_m);
  const float ahead = heading(place, place.into_m + look_m);
  const float behind = heading(place, place.into_m - look_m);
  const float slope = (ahead - behind) / (2 * look_m);
  const float bend = 0.5F * (ahead + behind) - here;
  const auto least = static_cast<float>(parameters_.heading_sigma_rad * parameters_.heading_sigma_rad);
  const float noise = least + bend * bend + kDetailM * kDetailM * slope * slope;
  const std::array<float, 4> h{c[kGg] + slope * c[kGp], c[kGb] + slope * c[kBp], c[kGp] + slope * c[kPp],
                               c[kGc] + slope * c[kPc]};
  const float variance = h[0] + slope * h[2] + noise;
  const float error = static_cast<float>(block.turned_rad) - here - place.offset_rad;
  const float squared = error * error / variance;
  place.log -= 0.5F * (std::min(squared, kMostSquared) + std::log(variance / (least + kTurnVariance)));
  if (squared > kMostSquared) {
    place.offset_rad += error;
    c[kGg] += error * error;
    return;
  }
  const float gain = error / variance;
  place.offset_rad += h[0] * gain;
  place.bias_per_m += h[1] * gain;
  place.into_m += h[2] * gain;
  place.scale_error += h[3] * gain;
  size_t at = 0;
  for (size_t i = 0; i < h.size(); ++i) {
    for (size_t k = i; k < h.size(); ++k) c[at++] -= h[i] * h[k] / variance;
  }
}

void PlaceFilter::weigh_marks(Place& place, const Trail& trail, const Block& block) const {
  const double rough_m = 2 * std::sqrt(std::max(0.0F, place.covariance[kPp]));
  for (const Mark& seen : block.marks) {
    // The body is half a lag behind the foot.
    const double at_m = place.into_m + seen.along_m * (1 + place.scale_error) + 0.5 * parameters_.lag_m;
    double likelihood = parameters_.false_per_m;
    const auto look = [&](uint32_t run, double begin_m) {
      for (const Mark& mapped : index_->marks_on(run)) {
        const double off_m = mapped.along_m + begin_m - at_m;
        if (alike(seen, mapped)) likelihood += parameters_.mark_density(off_m, rough_m);
      }
    };
    for (size_t i = 0; i < trail.size; ++i) look(trail.legs[i].run, trail.legs[i].begin_m);
    if (trail.size == 0 && place.before != NetworkIndex::kNoRun) look(place.before, -index_->length_m(place.before));
    look(place.run, 0);
    const auto& after = index_->after(place.run);
    if (!after.empty()) look(after.front(), index_->length_m(place.run));
    place.log += static_cast<float>(std::log(std::min(likelihood, 1.0) / parameters_.false_per_m));
  }
}

void PlaceFilter::drop_unlikely() {
  best_log_ = -INFINITY;
  for (const Place& place : places_) best_log_ = std::max(best_log_, place.log);
  const float least = best_log_ - static_cast<float>(kFarBelow);
  std::erase_if(places_, [&](const Place& place) { return place.log < least; });
}

// Those that have met go on as one.
void PlaceFilter::join_same() {
  struct Key {
    uint64_t cell;  // of all runs
    float log;
    uint32_t place;
  };
  std::vector<Key> keys(places_.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    const auto cell = static_cast<uint32_t>(static_cast<int32_t>(std::floor(places_[i].into_m / kSameM)));
    keys[i] = {uint64_t{places_[i].run} << 32U | cell, places_[i].log, static_cast<uint32_t>(i)};
  }
  std::sort(keys.begin(), keys.end(),
            [](const Key& a, const Key& b) { return std::tie(a.cell, b.log) < std::tie(b.cell, a.log); });
  for (size_t i = 1; i < keys.size(); ++i) {
    if (keys[i].cell == keys[i - 1].cell) places_[keys[i].place].log = -INFINITY;
  }
  std::erase_if(places_, [](const Place& place) { return place.log == -INFINITY; });
}

std::vector<Candidate> PlaceFilter::candidates(size_t gone_bins) const {
  const float least = best_log_ - static_cast<float>(kLikelyBelow);
  std::vector<Candidate> candidates;
  for (const Place& place : places_) {
    if (place.log < least) continue;
    const float length_m = index_->length_m(place.run);
    candidates.push_back({index_->run(place.run), std::clamp(place.into_m, 0.0F, length_m), taken_bins_ - gone_bins,
                          1.0 + place.scale_error, std::sqrt(std::max(0.0F, place.covariance[kCc])), place.log});
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) { return a.log > b.log; });
  return candidates;
}

}  // namespace railfix::map_matcher
