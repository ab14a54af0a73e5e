// Where position reports to compare come from: a file, a recording, or what a train sends now.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "compare/report_file.hpp"
#include "topic_listener.hpp"

namespace railfix::tool {

class ReportSource {
 public:
  /// `where`: a run's folder, .csv or .jsonl (compare::read_reports), a recording (.mcap), or topic:TRAIN for the
  /// train_position_report of a train on this network. The baseline is for files that do not say theirs. Throws
  /// BadInput when it cannot be read.
  ReportSource(const std::string& where, etcs::Baseline baseline, TrainNetwork network);

  [[nodiscard]] bool live() const { return listener_ != nullptr; }
  /// REQUIRES: live(). Takes what comes for so long; false after Ctrl-C.
  bool listen(double for_s);
  /// Sorted by time.
  [[nodiscard]] const std::vector<compare::TimedReport>& reports() const { return reports_; }
  /// Reports that came once more, alike with the same stamp, and count once: MQTT may deliver twice.
  [[nodiscard]] size_t repeated() const { return repeated_; }
  /// Lines or samples that hold no report; the first of them were named on standard error.
  [[nodiscard]] size_t left_out() const { return left_out_; }
  /// The other end's clock is put forward by this.
  void shift(int64_t offset_ns);

 private:
  void read_recording(const std::string& file);
  void take(const msg::TrainPositionReport& report);
  void add(compare::TimedReport report);

  std::vector<compare::TimedReport> reports_;
  size_t repeated_ = 0;
  size_t left_out_ = 0;
  int64_t offset_ns_ = 0;
  std::string refusal_;  // why reports were left out, told once
  std::unique_ptr<TopicListener> listener_;
};

}  // namespace railfix::tool
