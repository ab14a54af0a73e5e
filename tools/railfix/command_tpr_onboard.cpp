// `railfix tpr onboard`: in place of the ETCS on-board unit, as long as none is connected.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iostream>
#include <iterator>
#include <memory>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "command_tpr.hpp"
#include "core/joined.hpp"
#include "core/time.hpp"
#include "etcs/report_parameters.hpp"
#include "etcs/train_position_report.hpp"
#include "messaging/onboard_topic.hpp"
#include "number_between.hpp"
#include "topic_listener.hpp"

namespace railfix::tool {

namespace {

constexpr int64_t kPeriodNs = core::kNsPerSecond;
constexpr int64_t kClockStepNs = core::kNsPerSecond / 2;

using Names = std::vector<std::string>;
// By their values in message 136 and in REPORT_* from REPORT_BORDER on.
const Names kModes{"FS", "OS", "SR", "SH", "UN", "SL", "SB", "TR", "PT",
                   "SF", "IS", "NL", "LS", "SN", "RV", "PS", "AD", "SM"};
const Names kLevels{"0", "NTC", "1", "2", "3"};
const Names kIntegrities{"none", "device", "driver", "lost"};
const Names kCabs{"unsaid", "camera", "other"};
const Names kReports{"border", "session", "error"};

struct OnboardOptions {
  std::vector<std::string> words;
  TrainNetwork network;
  double for_s = 0;
};

uint8_t index_of(const std::string& word, const Names& names, const std::string& value) {
  const auto found = std::ranges::find(names, value);
  if (found != names.end()) return static_cast<uint8_t>(found - names.begin());
  throw core::BadInput(word + ": must be one of " + core::joined(names));
}

/// Metres may be broken, what counts or names may not.
template <class Number>
Number number_of(const std::string& word, const std::string& value, Number most) {
  Number number = 0;
  const char* end = value.data() + value.size();
  const auto parsed = std::from_chars(value.data(), end, number);
  if (parsed.ec == std::errc() && parsed.ptr == end && number >= 0 && number <= most) return number;
  std::ostringstream said;
  said << word << ": must be a " << (std::is_integral_v<Number> ? "whole " : "") << "number from 0 to " << most;
  throw core::BadInput(said.str());
}

/// What the words have said so far.
class OnboardUnit {
 public:
  OnboardUnit() { status_.m_level(etcs::kLevel2); }

  /// "mode=OS level=2 ...": all of the line or, with BadInput, nothing of it.
  void hear(const std::string& line) {
    const OnboardUnit before = *this;
    std::istringstream stream(line);
    std::vector<std::string> words{std::istream_iterator<std::string>(stream), {}};
    // The group of a packet 58 may stand before it.
    std::stable_partition(words.begin(), words.end(),
                          [](const std::string& word) { return word.starts_with("packet_58="); });
    try {
      for (const std::string& word : words) take(word);
    } catch (const core::BadInput&) {
      *this = before;
      throw;
    }
  }
  /// `ahead_ns`: the time of the data minus the host's.
  [[nodiscard]] msg::OnboardStatus status(int64_t ahead_ns) const {
    auto status = status_;
    status.stamp_ns(core::wall_ns() + ahead_ns);
    if (status.q_integrity() == etcs::kConfirmedByDevice)
      status.integrity_ns(status.stamp_ns());  // a device confirms all the time
    if (status.q_integrity() == etcs::kConfirmedByDriver) status.integrity_ns(status_.integrity_ns() + ahead_ns);
    return status;
  }
  [[nodiscard]] std::string text() const {
    std::ostringstream text;
    text << "mode " << kModes[status_.m_mode()] << ", level " << kLevels[status_.m_level()];
    if (status_.m_level() == etcs::kLevelNtc) text << " (" << int{status_.nid_ntc()} << ")";
    if (status_.active_cab() > 0) text << ", cab " << kCabs[status_.active_cab()];
    if (status_.packet_58_bytes() > 0) text << ", packet 58 of " << status_.packet_58_bytes() << " bytes";
    if (status_.packet_58_lrbg() > 0) text << " from LRBG " << status_.packet_58_lrbg();
    if (status_.packet_58_deleted() > 0) text << ", no packet 58";
    text << ", integrity " << kIntegrities[status_.q_integrity()] << ", length ";
    status_.train_length_m() > 0 ? text << status_.train_length_m() << " m" : text << "not known";
    return text.str();
  }

 private:
  void take(const std::string& word) {
    const auto equals = std::min(word.find('='), word.size());
    const std::string name = word.substr(0, equals);
    const std::string value = equals < word.size() ? word.substr(equals + 1) : "";
    if (name == "mode") {
      status_.m_mode(index_of(word, kModes, value));
    } else if (name == "level") {
      status_.m_level(index_of(word, kLevels, value));
    } else if (name == "ntc") {
      status_.nid_ntc(static_cast<uint8_t>(number_of<uint32_t>(word, value, 255)));
    } else if (name == "integrity") {
      status_.q_integrity(index_of(word, kIntegrities, value));
      if (status_.q_integrity() == etcs::kConfirmedByDriver) status_.integrity_ns(core::wall_ns());
    } else if (name == "cab") {
      status_.active_cab(index_of(word, kCabs, value));
    } else if (name == "length") {
      status_.train_length_m(number_of<double>(word, value, 2000));
    } else if (name == "report") {
      status_.wanted_because(static_cast<uint8_t>(msg::REPORT_BORDER + index_of(word, kReports, value)));
      status_.reports_wanted(next(status_.reports_wanted()));
    } else if (name == "packet_58") {
      take_packet_58(word, value);
    } else if (name == "lrbg") {
      status_.packet_58_lrbg(number_of<uint32_t>(word, value, etcs::kUnknownBaliseGroup));
    } else {
      throw core::BadInput(word +
                           ": must be mode=, level=, ntc=, cab=, integrity=, length=, report=, packet_58= or lrbg=");
    }
  }
  /// Higher than any of whoever spoke before: seconds do not come twice.
  static uint32_t next(uint32_t count) {
    return std::max(count + 1, static_cast<uint32_t>(core::wall_ns() / core::kNsPerSecond));
  }
  void take_packet_58(const std::string& word, const std::string& hex) {
    status_.packet_58_lrbg(0);
    status_.packet_58_deleted(hex == "none" ? 1 : 0);
    if (hex == "none") return status_.packet_58_bytes(0);
    const auto bytes = etcs::parse_hex(hex);
    if (!bytes.ok()) throw core::BadInput(word + ": " + bytes.error().message);
    const auto& packet = bytes.value();
    if (const auto parameters = etcs::decode_report_parameters(packet); !parameters.ok())
      throw core::BadInput(word + ": " + parameters.error().message);
    if (packet.size() > status_.packet_58().size()) throw core::BadInput(word + ": is longer than a packet 58 can be");
    std::ranges::copy(packet, status_.packet_58().begin());
    status_.packet_58_bytes(static_cast<uint32_t>(packet.size()));
    status_.packets_58(next(status_.packets_58()));
  }
  msg::OnboardStatus status_;
};

/// Whole lines of standard input, without waiting for them.
class Lines {
 public:
  std::vector<std::string> take() {
    std::vector<std::string> lines;
    // In the background a program that reads its terminal would be stopped.
    if (isatty(STDIN_FILENO) == 1 && tcgetpgrp(STDIN_FILENO) != getpgrp()) return lines;
    pollfd input{STDIN_FILENO, POLLIN, 0};
    while (!ended_ && poll(&input, 1, 0) > 0) {
      std::array<char, 4096> bytes{};
      const ssize_t count = read(STDIN_FILENO, bytes.data(), bytes.size());
      ended_ = count <= 0;
      if (!ended_) text_.append(bytes.data(), static_cast<size_t>(count));
    }
    for (size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      lines.push_back(text_.substr(0, end));
      text_.erase(0, end + 1);
    }
    return lines;
  }

 private:
  std::string text_;
  bool ended_ = false;
};

class Station {
 public:
  explicit Station(const OnboardOptions& options)
      : options_(options),
        listener_(options.network, "railfix-tpr-onboard"),
        writer_(listener_.participant(), messaging::topics::onboard_status) {
    // Played data has its own time.
    listener_.listen(messaging::topics::data_clock.name,
                     [this](const auto&, const auto&, const auto& sample, const auto&) {
                       const auto& clock = *static_cast<const msg::DataClock*>(sample.get());
                       const int64_t ahead_ns = clock.data_ns() - clock.wall_ns();
                       // One offset, lest the same confirmation looks like a new one every time.
                       if (std::abs(ahead_ns - data_ahead_ns_) > kClockStepNs) data_ahead_ns_ = ahead_ns;
                     });
  }

  int speak(OnboardUnit unit) {
    say(unit);
    listener_.run(options_.for_s, [&] {
      bool changed = false;
      for (const auto& line : lines_.take()) changed |= heard(unit, line);
      if (!heard_once_ && writer_.matched_readers() > 0) {
        heard_once_ = true;
        next_ns_ = 0;
      }
      if (changed) say(unit);
      if (core::monotonic_ns() >= next_ns_) write(unit);
      return false;
    });
    if (heard_once_) return 0;
    std::cerr << "nobody read it: there is no tpr_publisher on " << where(options_.network)
              << "; is it running, and are --train and --domain right?\n";
    return 1;
  }

 private:
  bool heard(OnboardUnit& unit, const std::string& line) {
    try {
      unit.hear(line);
      return true;
    } catch (const core::BadInput& error) {
      std::cerr << error.what() << '\n';
      return false;
    }
  }
  void say(const OnboardUnit& unit) {
    std::cout << unit.text() << std::endl;
    write(unit);
  }
  void write(const OnboardUnit& unit) {
    auto status = unit.status(data_ahead_ns_);
    // Its locations count from where the train is when it comes: nobody knows that of one that has always been there.
    if (!introduced_) status.packet_58_bytes(0);
    introduced_ = heard_once_;
    writer_.write(status);
    next_ns_ = core::monotonic_ns() + kPeriodNs;
  }

  OnboardOptions options_;
  TopicListener listener_;
  messaging::Writer<msg::OnboardStatus> writer_;
  Lines lines_;
  int64_t data_ahead_ns_ = 0;
  int64_t next_ns_ = 0;
  bool heard_once_ = false;
  bool introduced_ = false;  // has spoken to somebody
};

}  // namespace

void add_tpr_onboard(CLI::App& tpr, Action& chosen) {
  auto options = std::make_shared<OnboardOptions>();
  auto* command = tpr.add_subcommand(
      "onboard", "Say what the ETCS on-board unit would: mode, level, train integrity, and when it wants a report");
  command->footer(
      "Example: railfix tpr onboard mode=FS level=2 integrity=driver length=200\n"
      "  mode=FS, OS, SR, SH, UN, SL, SB, TR, PT, SF, IS, NL, LS, SN, RV, PS, and in 4.0.0 AD, SM   level=0, NTC, 1, "
      "2, 3\n"
      "  ntc=NID_NTC   integrity=none, device, driver, lost   length=safe length in m, 0 = not known\n"
      "  cab=camera, other: at which end the active cab is, that of the camera or the other   report=border, session, "
      "error: a\n  report is wanted now   packet_58=HEX: position report parameters, none: they were deleted\n"
      "  lrbg=NID_LRBG, in one line with packet_58: of the message that brought it; without it the LRBG of now\n"
      "onboard_status is sent at every change and once a second until Ctrl-C. Lines of the same words on standard "
      "input\n"
      "change it. Silent for 3 s, tpr_publisher keeps mode and level and says nothing of train integrity.");
  command->add_option("WORD=VALUE", options->words, "As below; without any: mode=FS level=2 integrity=none");
  command->add_option("--for-s", options->for_s, "End after so many seconds, 0 = run until interrupted")
      ->check(number_between(0, 1e9));
  add_network(*command, options->network);
  find_running_train(*command, options->network);
  command->callback([options, &chosen] {
    chosen = [options] {
      OnboardUnit unit;
      std::string line;
      for (const auto& word : options->words) line += word + ' ';
      unit.hear(line);
      return Station(*options).speak(unit);
    };
  });
}

}  // namespace railfix::tool
