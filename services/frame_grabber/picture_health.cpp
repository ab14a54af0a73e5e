#include "frame_grabber/picture_health.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::frame_grabber {
namespace {

constexpr size_t kSaturatedGrey = 250;
constexpr double kDarkShare = 0.95;
constexpr uint32_t kFewestEdges = 30;
constexpr double kManyEdges = 300;
constexpr double kUsualWeight = 1.0 / 1000;  // of one picture
constexpr double kGoneShare = 0.05;          // of the usual number of edges
constexpr double kAsBright = 0.7;            // of the usual brightness
constexpr double kSharpestShare = 0.1;
// Tiles: noise of 3 grey leaves 0.8 in the mean of a window.
constexpr float kNoStructureGrey = 1.3F;
constexpr float kStructureGrey = 4.0F;
constexpr float kStillShare = 0.3F;  // change over structure
constexpr float kMovesShare = 0.6F;
constexpr float kNoiseGrey = 1.5F;
constexpr float kLitGrey = 24;           // darker tiles hide their structure
constexpr float kNotBurntOutGrey = 245;  // as do burnt-out ones
constexpr int64_t kReferenceNs = core::kNsPerSecond;
constexpr int kStillComparisons = 4;
constexpr double kMovingShare = 0.3;                         // of the track's tiles, for the others to be called still
constexpr int64_t kClockSetBackNs = 2 * core::kNsPerSecond;  // no picture is held up so long on its way
// A picture that is shown again though not to the last bit. Two pictures of one place differ by the camera's noise, a
// tenth of what motion changes; a picture and the same coded anew by less. The last pictures before a stop come closer
// and closer.
constexpr double kMovesPictureShare = 0.4;              // change over structure
constexpr double kRepeatShare = 0.05;                   // of the change before
constexpr int kFewestMoves = 5;                         // a knock on a standing train is shorter
constexpr int64_t kRepeatsNs = 5 * core::kNsPerSecond;  // later it may stand
constexpr int64_t kNextNs = 70'000'000;                 // pictures farther apart may show a stop between them
// The part of the track that is watched.
constexpr double kNearM = 3;
constexpr double kFarM = 25;
constexpr double kHalfWidthM = 2.5;
constexpr size_t kFewestTiles = 6;

/// The lower middle of the picture.
TileMask usual_track() {
  TileMask mask;
  for (int row = kTileRows / 2; row < kTileRows; ++row) {
    for (int column = kTileColumns / 4; column < kTileColumns * 3 / 4; ++column) mask.set(row * kTileColumns + column);
  }
  return mask;
}

}  // namespace

bool PictureHealth::Lasting::update(bool now, int64_t stamp_ns, int64_t long_enough_ns) {
  if (!now) {
    since_ns_.reset();
    return false;
  }
  if (!since_ns_ || stamp_ns < *since_ns_) since_ns_ = stamp_ns;
  return stamp_ns - *since_ns_ >= long_enough_ns;
}

void PictureHealth::watch_track(const geometry::Intrinsics& camera, const geometry::CameraPose& mount) {
  const geometry::View view(camera, mount);
  TileMask mask;
  for (int i = 0; i < kTiles; ++i) {
    const int row = i / kTileColumns;
    const Eigen::Vector2d centre((i % kTileColumns + 0.5) * camera.width_px / kTileColumns,
                                 (row + 0.5) * camera.height_px / kTileRows);
    const auto ground = view.on_plane(centre, 0);
    if (ground && ground->x() > kNearM && ground->x() < kFarM && std::abs(ground->y()) < kHalfWidthM) mask.set(i);
  }
  if (mask.count() >= kFewestTiles) track_ = mask;
}

uint32_t PictureHealth::judge(int64_t stamp_ns, const cv::Mat& grey) {
  if (!track_) track_ = usual_track();
  std::swap(now_, last_);
  now_.measure(grey);
  uint32_t health = exposure();
  if (repeated(stamp_ns, grey)) health |= kFrozen;
  if (newest_ns_ && stamp_ns <= *newest_ns_) health |= kOutOfOrder;
  const bool clock_set_back = newest_ns_ && *newest_ns_ - stamp_ns > kClockSetBackNs;
  newest_ns_ = clock_set_back ? stamp_ns : std::max(stamp_ns, newest_ns_.value_or(stamp_ns));
  if (health != 0) return health;  // the rest cannot be told from such a picture, and it lasts
  find_cover(stamp_ns);
  measure_sharpness();
  const int64_t persist_ns = core::to_ns(config_.persist_s);
  if (covered_.update(covered_share_ >= config_.covered_share, stamp_ns, persist_ns)) health |= kCovered;
  // Where few edges are left it stays as it was: a covered or blurred lens may leave none.
  if (sharpness_ && blurred_.update(*sharpness_ < config_.blurred_below, stamp_ns, persist_ns)) health |= kBlurred;
  return health;
}

uint32_t PictureHealth::exposure() const {
  const auto share = [this](size_t from, size_t to) {
    uint32_t count = 0;
    for (size_t value = from; value < to; ++value) count += now_.histogram[value];
    return static_cast<double>(count) / now_.pixels;
  };
  uint32_t health = 0;
  if (share(0, static_cast<size_t>(std::clamp(config_.dark_below_grey, 0.0, 256.0))) >= kDarkShare) health |= kDark;
  if (share(kSaturatedGrey, 256) >= config_.saturated_share) health |= kSaturated;
  return health;
}

bool PictureHealth::repeated(int64_t stamp_ns, const cv::Mat& grey) {
  const bool equal = seen_before(grey);
  const bool alike = shown_again(stamp_ns);
  repeats_ = equal || alike ? repeats_ + 1 : 0;
  return repeats_ >= config_.frozen_after_pictures;
}

/// Also by a driver that gives its last few buffers again and again.
bool PictureHealth::seen_before(const cv::Mat& grey) {
  const uint64_t own = fingerprint(grey);
  const auto known = fingerprints_.begin() + static_cast<std::ptrdiff_t>(std::min(pictures_, fingerprints_.size()));
  const bool seen = std::find(fingerprints_.begin(), known, own) != known;
  if (!seen) fingerprints_[pictures_++ % fingerprints_.size()] = own;
  return seen;
}

/// From one picture to the next the track stands still to less than the camera's noise, though it ran by before. Where
/// a film has been standing for long nothing is said.
bool PictureHealth::shown_again(int64_t stamp_ns) {
  const int64_t since_last_ns = last_ns_ ? stamp_ns - *last_ns_ : 0;
  last_ns_ = stamp_ns;
  if (since_last_ns <= 0 || since_last_ns > kNextNs || last_.window_means.size() != now_.window_means.size()) {
    moves_ = 0;
    return false;
  }
  const auto changes = difference(now_, last_);
  double change = 0;
  double structure = 0;
  for (size_t i = 0; i < kTiles; ++i) {
    if (!track_->test(i)) continue;
    change += changes[i] - std::abs(now_.tiles[i].grey - last_.tiles[i].grey);  // light is no motion
    structure += std::max(now_.tiles[i].structure_grey, last_.tiles[i].structure_grey);
  }
  if (moves_ == 0 || change >= kRepeatShare * moved_) {
    alike_since_ns_.reset();
    moved_ = change;
    moves_ = change > kMovesPictureShare * structure ? moves_ + 1 : 0;
    return false;
  }
  if (!alike_since_ns_) alike_since_ns_ = stamp_ns;
  if (stamp_ns - *alike_since_ns_ > kRepeatsNs) moves_ = 0;
  return moves_ >= kFewestMoves;
}

void PictureHealth::find_cover(int64_t stamp_ns) {
  if (!reference_ns_ || reference_.window_means.size() != now_.window_means.size() || stamp_ns < *reference_ns_) {
    reference_ = now_;
    reference_ns_ = stamp_ns;
    still_ = {};
  } else if (stamp_ns - *reference_ns_ >= kReferenceNs) {
    compare_with_reference();
    reference_ = now_;
    reference_ns_ = stamp_ns;
  }
  size_t covered = 0;
  for (size_t i = 0; i < kTiles; ++i) {
    if (!track_->test(i)) continue;
    const auto& tile = now_.tiles[i];
    const bool readable = tile.grey > kLitGrey && tile.grey < kNotBurntOutGrey;
    if ((readable && tile.structure_grey < kNoStructureGrey) || still_[i] >= kStillComparisons) ++covered;
  }
  covered_share_ = static_cast<double>(covered) / static_cast<double>(track_->count());
}

/// At a standstill nothing moves, so nothing is learned.
void PictureHealth::compare_with_reference() {
  const auto changes = difference(now_, reference_);
  TileMask still;
  size_t moving = 0;
  for (size_t i = 0; i < kTiles; ++i) {
    const float structure = std::max(now_.tiles[i].structure_grey, reference_.tiles[i].structure_grey);
    if (!track_->test(i) || structure < kStructureGrey) continue;
    if (changes[i] > kMovesShare * structure) ++moving;
    if (changes[i] < kNoiseGrey + kStillShare * (structure - kStructureGrey)) still.set(i);
  }
  if (static_cast<double>(moving) < kMovingShare * static_cast<double>(track_->count())) return;
  for (size_t i = 0; i < kTiles; ++i) still_[i] = still.test(i) ? still_[i] + 1 : 0;
}

void PictureHealth::measure_sharpness() {
  std::array<uint32_t, PictureTiles::kSlopeBins> slopes{};
  uint32_t edges = 0;
  double grey = 0;
  for (size_t i = 0; i < kTiles; ++i) {
    if (!track_->test(i)) continue;
    grey += now_.tiles[i].grey / static_cast<double>(track_->count());
    for (size_t bin = 0; bin < slopes.size(); ++bin) {
      slopes[bin] += now_.slopes[i][bin];
      edges += now_.slopes[i][bin];
    }
  }
  sharpness_.reset();
  if (edges < std::max<double>(kFewestEdges, kGoneShare * usual_edges_)) {
    if (usual_edges_ > kManyEdges && grey > kAsBright * usual_grey_) sharpness_ = 0;
    return;
  }
  const double weight = usual_edges_ == 0 ? 1 : kUsualWeight;
  usual_edges_ += weight * (edges - usual_edges_);
  usual_grey_ += weight * (grey - usual_grey_);
  double left = kSharpestShare * edges;
  size_t bin = slopes.size() - 1;
  while (bin > 0 && left > slopes[bin]) left -= slopes[bin--];
  sharpness_ = static_cast<double>(bin) / (PictureTiles::kSlopeBins - 1);
}

}  // namespace railfix::frame_grabber
