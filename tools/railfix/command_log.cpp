// `railfix log`: what the services say, live or from a recording.
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "mcap/reader.hpp"
#include "messaging/message_words.hpp"
#include "not_negative.hpp"
#include "recording/utc_text.hpp"
#include "topic_listener.hpp"

namespace railfix::tool {
namespace {

// As in LogRecord.level and common.log_level.
const std::vector<std::string> kLevels(messaging::kLevelNames.begin(), messaging::kLevelNames.end());

struct LogOptions {
  std::filesystem::path file;
  TrainNetwork network;
  bool follow = false;
  std::vector<std::string> services;
  std::string level = "trace";
  double for_s = 0;
  bool json = false;
};

bool wanted(const LogOptions& options, const msg::LogRecord& record) {
  const auto least = std::ranges::find(kLevels, options.level) - kLevels.begin();
  if (record.level() < least) return false;
  return options.services.empty() ||
         std::ranges::find(options.services, record.service().c_str()) != options.services.end();
}

void print(const LogOptions& options, const msg::LogRecord& record) {
  if (!wanted(options, record)) return;
  const std::string level = messaging::name_of_level(record.level());
  if (options.json) {
    const nlohmann::ordered_json json{{"time", utc_text(record.stamp_ns())},
                                      {"service", record.service().c_str()},
                                      {"host", record.host().c_str()},
                                      {"level", level},
                                      {"text", record.text().c_str()}};
    std::cout << core::json_text(json) << std::endl;
    return;
  }
  std::cout << utc_text(record.stamp_ns()) << ' ' << record.service().c_str() << ' ' << level << ": "
            << record.text().c_str() << std::endl;
}

int print_recorded(const LogOptions& options) {
  const auto reader = core::value_or_throw(mcap::Reader::open(options.file));
  reader->for_each({{messaging::topics::log_record.name}, {}, {}},
                   [&](const mcap::Channel&, const mcap::Message& message) {
                     msg::LogRecord record;
                     if (messaging::deserialize({message.data.begin(), message.data.end()}, record)) {
                       print(options, record);
                     }
                     return true;
                   });
  for (const auto& problem : reader->problems()) std::cerr << problem << '\n';
  return 0;
}

int follow(const LogOptions& options) {
  TopicListener listener(options.network, "railfix-log");
  listener.listen(messaging::topics::log_record.name, [&](const auto&, const auto&, const auto& sample, const auto&) {
    print(options, *static_cast<const msg::LogRecord*>(sample.get()));
  });
  listener.run(options.for_s, [] { return false; });
  return 0;
}

int log(const LogOptions& options) {
  if (!options.file.empty()) return print_recorded(options);
  if (options.follow) return follow(options);
  throw core::BadInput("give a recording, or -f to follow " + where(options.network) + " (--train, --domain)");
}

}  // namespace

void add_log(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<LogOptions>();
  auto* command = app.add_subcommand(
      "log",
      "What the services say, from now on (-f) or in a recording.  Example: railfix log -f --service fusion,odometry "
      "--level warning");
  command->add_option("FILE", options->file, "Recording (.mcap)");
  command->add_flag("-f,--follow", options->follow, "Follow a running train; Ctrl-C ends");
  add_network(*command, options->network);
  find_running_train(*command, options->network);
  command->add_option("--service", options->services, "Only these, separated by commas")->delimiter(',');
  command->add_option("--level", options->level, "Only this level and more severe ones")
      ->check(CLI::IsMember(kLevels))
      ->capture_default_str();
  command->add_option("--for", options->for_s, "End after this many seconds")->check(not_negative());
  command->add_flag("--json", options->json, "One JSON object a line");
  command->callback([options, &chosen] { chosen = [options] { return log(*options); }; });
}

}  // namespace railfix::tool
