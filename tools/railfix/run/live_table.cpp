#include "run/live_table.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "core/time.hpp"
#include "core/units.hpp"
#include "etcs/train_position_report.hpp"
#include "messaging/message_words.hpp"
#include "service_table.hpp"

namespace railfix::tool {
namespace {

constexpr int64_t kTerminalPeriodNs = core::kNsPerSecond;
constexpr int64_t kLinePeriodNs = 10 * core::kNsPerSecond;

std::string position_line(const TrainPicture& picture) {
  if (!picture.state) return "position: no train_state yet";
  const auto& s = *picture.state;
  const double elapsed_s = core::seconds(picture.data_ns - picture.data_begin_ns);
  const std::string where =
      s.track_known() != 0 ? fmt::format("edge {} at {:.2f} m", s.edge(), s.offset_m()) : "track not yet known";
  // Plus zero, so that a train at rest is not written as -0.0.
  const std::string speed =
      std::isnan(s.speed_mps())
          ? "speed not known"
          : fmt::format("{:.1f} km/h", std::round(10 * core::kmh_from_mps(s.speed_mps())) / 10 + 0.0);
  return fmt::format("{:6.1f} s  {}  -{:.2f}/+{:.2f} m  {}{}  travelled {:.1f} m  integrity {}", elapsed_s, where,
                     s.over_m(), s.under_m(), speed, s.standstill() != 0 ? " (standstill)" : "", s.distance_m(),
                     messaging::name_of_integrity(s.integrity()));
}

std::string counts_line(const TrainPicture& picture) {
  const double seen =
      picture.views == 0 ? 0 : 100.0 * static_cast<double>(picture.views_seen) / static_cast<double>(picture.views);
  std::string line = fmt::format("rails seen {:.1f} % of {} pictures  sightings {}  position reports {}", seen,
                                 picture.views, picture.sightings, picture.reports);
  if (picture.report && etcs::names_group(picture.report->nid_lrbg())) {
    line += fmt::format("  last: LRBG {}/{} + {:.1f} m", etcs::nid_c_of(picture.report->nid_lrbg()),
                        etcs::nid_bg_of(picture.report->nid_lrbg()), picture.report->d_lrbg_m());
  }
  return line;
}

}  // namespace

std::string table_of(const TrainPicture& picture) {
  std::string text = position_line(picture) + "\n" + counts_line(picture) + "\n";
  text += service_table(picture.services, false);
  for (const auto& line : picture.log) text += "! " + line + "\n";
  return text;
}

LiveTable::LiveTable() : terminal_(isatty(STDOUT_FILENO) == 1) {}

void LiveTable::update(const TrainPicture& picture) {
  const int64_t now_ns = core::monotonic_ns();
  if (now_ns - drawn_ns_ < (terminal_ ? kTerminalPeriodNs : kLinePeriodNs)) return;
  drawn_ns_ = now_ns;
  if (terminal_) return draw(picture);
  std::printf("%s\n", position_line(picture).c_str());
  std::fflush(stdout);
}

void LiveTable::finish(const TrainPicture& picture) {
  draw(picture);
}

void LiveTable::draw(const TrainPicture& picture) {
  const std::string text = table_of(picture);
  // Up to where the last table began, then every line cleared to its end: no flicker, no scrolling.
  if (terminal_ && drawn_lines_ > 0) std::printf("\x1b[%zuA\x1b[J", drawn_lines_);
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
  drawn_lines_ = static_cast<size_t>(std::count(text.begin(), text.end(), '\n'));
}

}  // namespace railfix::tool
