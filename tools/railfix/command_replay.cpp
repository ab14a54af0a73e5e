// `railfix replay`: a recording back onto the topics.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "key_reader.hpp"
#include "not_negative.hpp"
#include "number_between.hpp"
#include "progress.hpp"
#include "replay/player.hpp"

namespace railfix::tool {
namespace {

constexpr double kKeySeekS = 5;

struct CommandLine {
  ReplayOptions replay;
  std::vector<std::string> remaps;
  bool json = false;
};

std::atomic<Player*> running = nullptr;

void take_key(Player& player, const msg::PlayerStatus& now, const std::string& key) {
  const double into_s = core::seconds(now.at_ns() - now.from_ns());
  const double length_s = core::seconds(now.to_ns() - now.from_ns());
  const auto seek = [&](double by_s) { player.post("seek", std::to_string(std::clamp(into_s + by_s, 0.0, length_s))); };
  if (key == "q") player.stop();
  if (key == " ") player.post(now.state() == msg::PLAYER_PLAYING ? "pause" : "play", "");
  if (key == "." || key == "n") player.post("step", "");
  if (key == "left") seek(-kKeySeekS);
  if (key == "right") seek(kKeySeekS);
  if (key == "up") player.post("rate", std::to_string(now.rate() * 2));
  if (key == "down") player.post("rate", std::to_string(now.rate() / 2));
  if (key == "l") player.post("loop", now.looped() != 0 ? "off" : "on");
}

std::string status_line(const msg::PlayerStatus& status) {
  static constexpr std::array kStates{"playing", "paused", "ended"};
  char text[160];
  std::snprintf(text, sizeof text, "\r%-7s %8.1f of %.1f s  x%.2g%s  [space . left right up down l q]\x1b[K",
                kStates.at(std::min<size_t>(status.state(), 2)), core::seconds(status.at_ns() - status.from_ns()),
                core::seconds(status.to_ns() - status.from_ns()), status.rate(), status.looped() != 0 ? "  loop" : "");
  return text;
}

/// Plays, with keys and a line of status on a terminal, with a progress bar elsewhere.
ReplayReport play(Player& player) {
  std::mutex mutex;
  msg::PlayerStatus now;
  KeyReader keys([&](const std::string& key) {
    const std::lock_guard lock(mutex);
    take_key(player, now, key);
  });
  std::optional<Progress> progress;
  player.on_status([&](const msg::PlayerStatus& status) {
    const std::lock_guard lock(mutex);
    now = status;
    if (keys.reads()) {
      std::cerr << status_line(status) << std::flush;
      return;
    }
    if (status.looped() != 0) return;  // there is no end to come nearer to
    const double length_s = core::seconds(status.to_ns() - status.from_ns());
    if (!progress) progress.emplace("replay (seconds)", static_cast<uint64_t>(std::max(1.0, std::ceil(length_s))));
    progress->update(static_cast<uint64_t>(std::ceil(core::seconds(status.at_ns() - status.from_ns()))));
  });
  const auto report = player.run();
  if (keys.reads()) std::cerr << '\n';
  return report;
}

void print(const ReplayReport& report, const CommandLine& line) {
  if (line.json) {
    const nlohmann::ordered_json json{{"samples", report.samples},         {"topics", report.topics},
                                      {"late_p50_ms", report.late_p50_ms}, {"late_p99_ms", report.late_p99_ms},
                                      {"late_max_ms", report.late_max_ms}, {"problems", report.problems}};
    std::cout << core::json_text(json, 2) << '\n';
    return;
  }
  std::cout << report.samples << " samples of " << report.topics << " topics published for "
            << where(line.replay.network) << '\n';
  if (!line.replay.lock_step.empty()) return;
  std::printf("later than due: p50 %.3f ms, p99 %.3f ms, at most %.1f ms\n", report.late_p50_ms, report.late_p99_ms,
              report.late_max_ms);
}

int replay(CommandLine line) {
  for (const auto& remap : line.remaps) {
    const size_t equals = remap.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == remap.size()) {
      throw core::BadInput("--remap " + remap + " must be RECORDED=NOW, such as camera_frame/cam0=camera_frame/cam1");
    }
    line.replay.remaps[remap.substr(0, equals)] = remap.substr(equals + 1);
  }
  if (!line.replay.lock_step.empty() && line.replay.rate != 1) {
    throw core::BadInput("--rate and --lock-step exclude each other: in lock step the services set the rate");
  }
  Player player(line.replay);
  running = &player;
  for (const int signal : {SIGINT, SIGTERM}) {
    std::signal(signal, [](int) {
      if (Player* now = running) now->stop();
    });
  }
  const auto report = play(player);
  running = nullptr;
  for (const auto& problem : report.problems) std::cerr << problem << '\n';
  print(report, line);
  return report.samples > 0 ? 0 : 1;
}

void add_options(CLI::App& command, CommandLine& line) {
  ReplayOptions& options = line.replay;
  command.add_option("FILE", options.file, "Recording (.mcap, also one that was cut off)")->required();
  command.add_option("--rate", options.rate, "Times faster than recorded")
      ->capture_default_str()
      ->check(number_between(0.01, 1000.0));
  command
      .add_option("--topics", options.topics,
                  "Only these, separated by commas; without it all but commands and the data clock")
      ->delimiter(',');
  command.add_option("--without", options.without, "Not these, separated by commas")->delimiter(',');
  command.add_option("--remap", line.remaps, "RECORDED=NOW: publish a topic under another name; may be repeated");
  add_network(command, options.network);
  command.add_option("--from", options.from_s, "Begin this many seconds into the recording")->check(not_negative());
  command.add_option("--to", options.to_s, "End this many seconds into the recording")->check(not_negative());
  command.add_flag("--loop", options.loop, "Begin again at the end");
  command.add_flag("--paused", options.paused, "Wait for `play` or `step`");
  command.add_flag("--controlled", options.controlled, "Wait for commands at the end too; Ctrl-C ends");
  command
      .add_option("--lock-step", options.lock_step,
                  "Services that run with common.lock_step, separated by commas: each picture waits for them, and what "
                  "they write is not replayed")
      ->delimiter(',');
  command.add_flag("--json", line.json, "What was done, as JSON on standard output");
}

}  // namespace

void add_replay(CLI::App& app, Action& chosen) {
  auto line = std::make_shared<CommandLine>();
  auto* command = app.add_subcommand("replay", "Publish a recording again with its own timing");
  command->footer(
      "Examples:\n"
      "  railfix replay run.mcap --topics track_view --train test\n"
      "  railfix replay run.mcap --lock-step map_matcher,fusion --train test   through services of now, the same every "
      "time\n"
      "Keys on a terminal: space pauses, `.` plays one picture, left and right seek, up and down change the rate, l "
      "loops, q ends.\n"
      "Over DDS: service_control for `player`: play, pause, step, seek SECONDS, rate X, loop on|off, stop; "
      "player_status tells.");
  add_options(*command, *line);
  command->callback([&chosen, line] { chosen = [line] { return replay(*line); }; });
}

}  // namespace railfix::tool
