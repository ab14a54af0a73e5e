// Which stamps are to be believed: one wild stamp, a sensor whose clock is another one, a clock that was set.
//
// The odometers decide what time it is: they are what the train's way is counted by. While one of them goes on in the
// time of before, what others stamp elsewhere is left out; an IMU decides where no odometer does, GNSS and fixes where
// nothing measures motion.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

enum class Stamp : uint8_t { sound, ahead, behind };

/// A plain value.
class StampWatch {
 public:
  struct Verdict {
    Stamp stamp = Stamp::sound;
    bool believed = false;  // ahead or behind: it goes on from there, with those that are held
    bool first = false;     // of those that are held now
  };
  /// now_ns: time until now; oldest_ns: what is not newer is too late to be used.
  Verdict judge(const Event& event, int64_t now_ns, int64_t oldest_ns, double max_jump_s);
  /// The measurements ahead, or behind, that are not believed yet, in the order in which they came. They are forgotten.
  std::vector<Event> take_held(Stamp side);
  [[nodiscard]] bool holds_behind() const { return !behind_.held.empty(); }
  /// Whose samples are left out for their stamps again and again; in words, empty = nobody's.
  [[nodiscard]] std::string left_out(int64_t now_ns) const;
  /// Newest sound stamp of what measures motion; 0 = none yet.
  [[nodiscard]] int64_t newest_motion_ns() const { return newest_of_rank(1); }

 private:
  static constexpr size_t kKinds = std::variant_size_v<Event>;
  struct Side {
    std::array<int, kKinds> in_row{};
    std::vector<Event> held;
    std::array<int64_t, kKinds> last_held_ns{};
    int64_t last_ns = 0;  // when the last of them came, in the time of the others
  };
  [[nodiscard]] int64_t newest_of_rank(int least) const;
  /// Whether an odometer went on lately.
  [[nodiscard]] bool has_odometer(int64_t now_ns) const;
  void hear_sound(const Event& event);
  void leave_out(size_t kind, int64_t now_ns);
  [[nodiscard]] int enough(const Event& event, Stamp side, int64_t now_ns) const;

  struct LeftOut {
    int in_row = 0;
    int64_t last_ns = 0;  // in the time of the others
  };
  std::array<int64_t, kKinds> newest_ns_{};  // of each kind
  std::array<LeftOut, kKinds> left_out_{};
  Side ahead_;
  Side behind_;
};

}  // namespace railfix::fusion
