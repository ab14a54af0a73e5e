#include "report_source.hpp"

#include <algorithm>
#include <iostream>

#include "mcap/reader.hpp"
#include "messaging/samples.hpp"

namespace railfix::tool {

namespace {

constexpr const char* kTopic = "topic:";
constexpr size_t kMostNamed = 5;

}  // namespace

ReportSource::ReportSource(const std::string& where, etcs::Baseline baseline, TrainNetwork network) {
  if (where.starts_with(kTopic)) {
    network.train = where.substr(std::string(kTopic).size());
    if (network.train.empty()) throw core::BadInput(where + " lacks the name of the train; write topic:TRAIN");
    listener_ = std::make_unique<TopicListener>(network, "railfix-tpr-compare");
    listener_->listen(messaging::topics::train_position_report.name,
                      [this](const auto&, const auto&, const auto& sample, const auto&) {
                        take(*static_cast<const msg::TrainPositionReport*>(sample.get()));
                      });
  } else if (where.ends_with(".mcap")) {
    read_recording(where);
  } else {
    auto log = core::value_or_throw(compare::read_reports(where, baseline));
    for (auto& report : log.reports) add(std::move(report));
    left_out_ = log.lines_refused.size();
    for (size_t i = 0; i < std::min(left_out_, kMostNamed); ++i) std::cerr << log.lines_refused[i] << '\n';
  }
}

void ReportSource::read_recording(const std::string& file) {
  const auto reader = core::value_or_throw(mcap::Reader::open(file));
  reader->for_each({{messaging::topics::train_position_report.name}, {}, {}},
                   [this](const mcap::Channel&, const mcap::Message& message) {
                     msg::TrainPositionReport report;
                     if (messaging::deserialize({message.data.begin(), message.data.end()}, report)) take(report);
                     return true;
                   });
  for (const auto& problem : reader->problems()) std::cerr << problem << '\n';
}

void ReportSource::take(const msg::TrainPositionReport& report) {
  const auto in_time = compare::check_stamp(report.stamp_ns());
  auto fields = etcs::decode(messaging::bytes_of(report), static_cast<etcs::Baseline>(report.baseline()));
  if (!in_time.ok() || !fields.ok()) {
    ++left_out_;
    if (refusal_.empty()) {
      refusal_ = in_time.ok() ? fields.error().message : in_time.error().message;
      std::cerr << "a report was left out: " << refusal_ << '\n';
    }
    return;
  }
  add({report.stamp_ns() + offset_ns_, std::move(fields).value()});
}

void ReportSource::add(compare::TimedReport report) {
  const auto later = std::upper_bound(reports_.begin(), reports_.end(), report.stamp_ns,
                                      [](int64_t stamp, const auto& other) { return stamp < other.stamp_ns; });
  for (auto before = later; before != reports_.begin();) {
    if ((--before)->stamp_ns != report.stamp_ns) break;
    if (*before == report) {
      ++repeated_;
      return;
    }
  }
  reports_.insert(later, std::move(report));
}

bool ReportSource::listen(double for_s) {
  listener_->run(for_s, [] { return false; });
  return !TopicListener::stopped();
}

void ReportSource::shift(int64_t offset_ns) {
  offset_ns_ = offset_ns;
  for (auto& report : reports_) report.stamp_ns += offset_ns;
}

}  // namespace railfix::tool
