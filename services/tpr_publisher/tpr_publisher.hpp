// Train states in, position reports out: LRBG, fields, and the moments when they are due. No clock: the caller says
// what time it is.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "tpr_publisher/balise_tracker.hpp"
#include "tpr_publisher/held_doubt.hpp"
#include "tpr_publisher/position_report.hpp"
#include "tpr_publisher/report_trigger.hpp"
#include "tpr_publisher/train_integrity.hpp"

namespace railfix::tpr_publisher {

struct Settings {
  ReportSettings report;
  etcs::ReportParameters parameters;
  double train_length_m = 0;   // 0 = not known
  double foot_to_rear_m = -1;  // as TrainEnds
  double search_behind_m = 5000;
};

struct Report {
  int64_t stamp_ns = 0;  // of the train's position
  int64_t sent_ns = 0;
  Reason reason = Reason::start;
  etcs::TrainPositionReport fields;
  std::vector<uint8_t> message;
};

/// At most one of the two; neither when nothing is due.
struct Outcome {
  std::optional<Report> report;
  std::string refusal;  // a report is due but cannot be sent: why
};

class TprPublisher {
 public:
  /// Without a map (nullptr) every report says "LRBG unknown". Throws BadInput when the settings cannot be encoded.
  TprPublisher(std::shared_ptr<const track::Map> map, const Settings& settings);

  /// A report must be younger than 1 s when it is sent (SUBSET-041 5.3.1.3): an older position gives a refusal and the
  /// report stays due.
  Outcome update(const TrainPosition& position, int64_t now_ns);
  /// T_TRAIN of a report of another tpr_publisher: reports of this one are later.
  void hear_trainborne(uint32_t t_train, int64_t now_ns);
  /// That one has reported a confirmation of integrity with a position of that time: in 4.0.0 it is not said again.
  void hear_confirmed(int64_t stamp_ns);
  /// T_TRAIN's time of the last report, 0 = none; and that of a process before, after which reports of this one are.
  [[nodiscard]] int64_t trainborne_ns() const { return sent_trainborne_ns_; }
  void go_on_after(int64_t trainborne_ns) { sent_trainborne_ns_ = std::max(sent_trainborne_ns_, trainborne_ns); }
  /// Another tpr_publisher reports: follows the train, and begins with a report of its own when update() is called
  /// next.
  void watch(const TrainPosition& position, int64_t now_ns);
  /// Time goes on without a position: says that no report can be sent, whether one is due or not.
  Outcome tick(int64_t now_ns);
  /// A packet 58 from trackside. One for the other orientation than the train's (Q_DIR) is refused, as 3.6.3.1.3 asks.
  /// `origin`, `waited`: the group that Q_DIR and locations refer to, as for the trigger.
  core::Status set_parameters(const etcs::ReportParameters& parameters, std::optional<uint32_t> origin = std::nullopt,
                              bool waited = false);
  /// Whether such a packet can be judged.
  [[nodiscard]] bool direction_known(std::optional<uint32_t> origin = std::nullopt) const;
  /// Those of the settings again.
  void delete_parameters() { trigger_.set_parameters(settings_.parameters); }
  /// The group that its locations count from, when it has any and it is known.
  [[nodiscard]] std::optional<uint32_t> origin() const { return trigger_.origin(); }
  /// It has locations, and they are over: the cab was changed since, or their group is not on the train's way.
  [[nodiscard]] bool locations_given_up() const { return trigger_.locations_given_up(); }
  /// What the on-board unit says replaces mode and level of the settings. A mode or level that cannot be encoded leaves
  /// the one before and is the error; all the rest counts. Of one whose clock is more than a second ahead no
  /// confirmation of the train's integrity is taken, also not afterwards: its time would be taken for the place of a
  /// later one.
  core::Status set_onboard(const Onboard& onboard, int64_t now_ns);
  /// A newer one was heard lately: this is what another writer has left behind.
  [[nodiscard]] bool onboard_overtaken(int64_t stamp_ns, int64_t now_ns) const;
  /// The on-board unit was heard once, but not lately: its mode and level stand, train integrity is not known.
  [[nodiscard]] bool onboard_silent(int64_t now_ns) const;
  [[nodiscard]] bool onboard_heard(int64_t now_ns) const { return onboard_ && !onboard_silent(now_ns); }
  /// It was never heard: mode and level are those of the settings.
  [[nodiscard]] bool mode_assumed() const { return !onboard_; }
  /// What the reports leave out of what the on-board unit says, and why; empty = nothing.
  [[nodiscard]] std::string left_out(int64_t now_ns) const;
  /// Nobody knows where the train's front is, and why; empty = it is known.
  [[nodiscard]] std::string front_unknown() const;
  /// The track has not been declared for so long a way that balise groups may have been passed; empty = it has.
  [[nodiscard]] std::string undeclared() const;

 private:
  static constexpr int64_t kMostAheadNs = core::kNsPerSecond;  // the on-board unit's clock

  void follow(const TrainPosition& position);
  /// `since_s`: since the state before; nothing = its way was not followed.
  void follow_motion(const TrainPosition& position, std::optional<double> since_s);
  void hear_cab(ActiveCab cab);
  [[nodiscard]] bool is_turned() const { return cab_ == ActiveCab::other; }
  /// With the doubt of an undeclared track; along the train's own axis, as the ones below.
  [[nodiscard]] TrainPosition doubted_position() const;
  [[nodiscard]] Motion motion() const { return is_turned() ? turned(motion_) : motion_; }
  [[nodiscard]] std::optional<Reference> along_train(std::optional<Reference> found) const;
  /// The present LRBG, or the group that is named, as find() has it.
  [[nodiscard]] std::optional<Reference> reference(std::optional<uint32_t> group = std::nullopt) const;
  /// On the way that was run, on the map behind the train that began, or a little in front of it.
  [[nodiscard]] std::optional<Reference> find(uint32_t group, std::optional<double> expected_foot_m) const;
  /// The group that locations count from; foot_m: travelled distance.
  [[nodiscard]] std::optional<Reference> trigger_origin(double foot_m) const;
  /// Of the train to that group.
  [[nodiscard]] uint32_t orientation_to(std::optional<uint32_t> group) const;
  /// What nobody knows of the place of the group that is referred to.
  [[nodiscard]] double group_m() const;
  [[nodiscard]] TrainIntegrity::Place place_of_now() const;
  /// By how much the place was corrected against the travelled distance; infinite = nobody knows.
  [[nodiscard]] double moved_m(const TrainPosition& before) const;
  core::Status hear_mode_and_level(const Onboard& onboard);
  void hear_wants(const Onboard& onboard);
  void hear_integrity(const Onboard& onboard, int64_t now_ns);
  [[nodiscard]] Moment moment(int64_t now_ns) const;
  [[nodiscard]] etcs::TrainPositionReport fields(int64_t now_ns) const;
  [[nodiscard]] int64_t trainborne_ns(int64_t now_ns) const;
  void sent(const Report& report, const Moment& moment);

  Settings settings_;
  std::optional<BaliseTracker> tracker_;
  HeldDoubt doubt_;
  ReportTrigger trigger_;
  TrainIntegrity integrity_;
  std::optional<Onboard> onboard_;  // its stamp is never later than when it was heard
  bool length_said_ = false;        // by the on-board unit, which may take it back
  int64_t complete_ns_ = 0;         // its integrity_ns in this host's clock ...
  int64_t complete_ahead_ns_ = 0;   // ... and how far it was ahead when it was heard first
  int64_t onboard_ahead_ns_ = 0;    // too much of it, and no confirmation is taken
  uint32_t mode_changes_ = 0;
  uint32_t level_changes_ = 0;
  uint32_t wants_ = 0;
  Reason wanted_because_ = Reason::session;
  int64_t trainborne_ahead_ns_ = 0;  // T_TRAIN's clock is ahead of the caller's, which was set back
  int64_t sent_trainborne_ns_ = 0;
  TrainEnds ends_;
  ActiveCab cab_ = ActiveCab::not_said;
  // Along the axis that the camera looks.
  std::optional<Reference> reference_;
  std::optional<TrainPosition> position_;
  Motion motion_ = Motion::unknown;  // the last one; kept at standstill
  double way_m_ = 0;                 // by its speed, since it last moved so
  bool rested_ = false;              // since it last moved for sure
};

}  // namespace railfix::tpr_publisher
