#include <pthread.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <thread>

#include "messaging/topic_layouts.hpp"
#include "service/health_file.hpp"
#include "service/loop.hpp"
#include "service/release.hpp"

namespace railfix::service {
namespace {

constexpr std::chrono::seconds kFoundByAll{1};

enum ExitCode { kDone = 0, kFailed = 1, kBadInput = 2 };

struct CommandLine {
  std::filesystem::path config;
  std::vector<std::string> sets;
  bool check = false;
  bool document = false;
  bool health = false;
  bool beside = false;
};

std::vector<Override> overrides_of(const std::vector<std::string>& sets) {
  std::vector<Override> overrides;
  for (const auto& text : sets) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || text.find('.') > equals) {
      throw core::BadInput("--set " + text + " must be section.key=value");
    }
    const Override change{text.substr(0, equals), text.substr(equals + 1)};
    const std::string section = change.key.substr(0, change.key.find('.'));
    const auto& known = service_names();
    if (section != "common" && std::find(known.begin(), known.end(), section) == known.end()) {
      throw core::BadInput("--set " + text + ": section " + section +
                           " belongs to no service; `--document` shows this service's sections");
    }
    overrides.push_back(change);
  }
  return overrides;
}

// SIGTERM and SIGINT end the loop from a thread of their own, so that everything is taken down in order.
class SignalWatch {
 public:
  SignalWatch() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGTERM);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGUSR2);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }
  void watch(Loop& loop) {
    thread_ = std::thread([this, &loop] {
      int signal = 0;
      do sigwait(&signals_, &signal);
      while (signal == SIGUSR2 && !done_);
      if (!done_) loop.post([&loop, signal] { loop.finish(signal == SIGTERM ? "SIGTERM" : "SIGINT"); });
    });
  }
  ~SignalWatch() {
    if (!thread_.joinable()) return;
    done_ = true;
    pthread_kill(thread_.native_handle(), SIGUSR2);
    thread_.join();
  }

 private:
  sigset_t signals_{};
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

int say_health(const CommonConfig& common, const std::string& service) {
  const auto answer = ask_health(health_path(common, service));
  std::cout << service << ": " << answer.text << '\n';
  return answer.works() ? kDone : kFailed;
}

// `railfix train` compares them: programs that were made of different ones do not hear each other.
int say_topics() {
  for (const auto& [idl, layout] : messaging::topic_layouts()) std::printf("topics %s %016lx\n", idl.c_str(), layout);
  return kDone;
}

// Who finds this service a moment later, as everybody does, would not hear what it logged at once.
void say_why_again(Loop& loop) {
  const char* end = std::getenv(kEndedBefore);
  if (end == nullptr || *end == '\0') return;
  const auto said = std::make_shared<bool>(false);
  loop.every_while([said] { return !*said; }, kFoundByAll,
                   [&loop, said, end = std::string(end)] {
                     *said = true;
                     loop.log().warn("started again: the process before {}", end);
                   });
}

int serve(const Program& program, const CommonConfig& common, bool beside) {
  SignalWatch signals;
  Loop loop(program.name, common, beside);
  signals.watch(loop);
  try {
    const auto service = program.make(loop);
    say_why_again(loop);
    loop.log().info("version {}, train {}, domain {}", release(), common.train_id, common.domain);
    loop.health().ready();
    loop.turn();
  } catch (const core::BadInput& error) {
    loop.log().error("{}", error.what());
    loop.health().failed(error.what());
    return dynamic_cast<const messaging::NoRoom*>(&error) != nullptr ? kFailed : kBadInput;
  } catch (const std::exception& error) {
    loop.log().critical("failed: {}", error.what());
    loop.health().failed(error.what());
    return kFailed;
  }
  return kDone;
}

}  // namespace

void CommonConfig::describe(Fields& fields) {
  fields.text("train_id", train_id, "Name of the train; services see only services of the same train.");
  fields.text("host", host, "Name of the computer that this service runs on, for status and log.");
  fields.integer("domain", domain, {0, 232}, "", "DDS domain of the train.");
  fields.choice("log_level", log_level, {"trace", "debug", "info", "warning", "error"},
                "Least severe message that is logged.");
  fields.text("qos_profiles", qos_profiles,
              "Fast DDS XML file that replaces the built-in quality of service; empty = built in.");
  fields.integer("ownership_strength", ownership_strength, {0, 1000}, "",
                 "0: the only fusion or tpr_publisher of this train; otherwise one of several, of which one is in "
                 "charge, of equally good ones the stronger.");
  fields.number("take_over_s", take_over_s, {0.1, 10}, "s",
                "A standby takes charge when it has not heard of the one in charge for so long.");
  fields.list("interfaces", interfaces,
              "Network interfaces, by name or IPv4 address, that DDS uses beside the loopback; empty = all.");
  fields.list("peers", peers,
              "IPv4 addresses of the train's other hosts, asked directly where multicast does not pass.");
  fields.text("security", security,
              "Folder with this service's certificate, key and permissions; empty = DDS without security.");
  fields.flag("lock_step", lock_step,
              "Use data in turns and answer on data_progress; set by `railfix run --pace lossless`.");
}

core::Status CommonConfig::check() const {
  for (const auto& [key, name] : {std::pair{"train_id", train_id}, std::pair{"host", host}}) {
    if (!is_name(name))
      return core::Error{std::string("common.") + key + " '" + name +
                         "' is no name of at most 64 letters, digits, '-', '_' and '.', such as re460-042"};
  }
  return {};
}

bool is_name(const std::string& text) {
  return !text.empty() && text.size() <= 64 &&
         std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.'; }) &&
         text.front() != '.' && text.front() != '-';
}

const std::vector<std::string>& service_names() {
  static const std::vector<std::string> names{"frame_grabber", "sensor_gateway", "track_detector",
                                              "odometry",      "map_matcher",    "fusion",
                                              "tpr_publisher", "recorder",       "monitor"};
  return names;
}

int run_program(const Program& program, int argc, char** argv) {
  CommandLine line;
  CLI::App app{"Railfix service " + program.name};
  app.add_option("--config", line.config,
                 "YAML file with the sections `common` and `" + program.name + "` (others are ignored)")
      ->envname("RAILFIX_CONFIG");
  app.add_option("--set", line.sets, "section.key=value, over the file; may be repeated");
  app.add_flag(
      "--check", line.check,
      "Read the configuration, say what is wrong with it, or which topics (IDL) the program was made of, and end");
  app.add_flag("--document", line.document, "Print every key with its default, unit, range and meaning, and end");
  app.add_flag("--health", line.health,
               "Ask the service that runs here with this configuration how it is, and end: exit code 0 or 1");
  app.add_flag("--beside", line.beside,
               "Another one of this service runs here: stand by until it has gone (what `railfix train upgrade` does)");
  app.set_version_flag("--version", std::string(release()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kBadInput;
  }
  if (line.document) {
    std::cout << document_config<CommonConfig>("common") << program.document();
    return kDone;
  }
  try {
    const auto overrides = overrides_of(line.sets);
    const auto common =
        core::value_or_throw(read_config<CommonConfig>("common", line.config, overrides, service_names()));
    core::ok_or_throw(common.check());
    if (line.health) return say_health(common, program.name);
    core::ok_or_throw(program.read(line.config, overrides));
    if (line.check) return say_topics();
    return serve(program, common, line.beside);
  } catch (const core::BadInput& error) {
    std::cerr << program.name << ": " << error.what() << '\n';
    return kBadInput;
  }
}

}  // namespace railfix::service
