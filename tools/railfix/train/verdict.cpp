#include "train/verdict.hpp"

#include <array>
#include <string_view>

#include "core/joined.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

constexpr double kSilentS = 5;

/// Those that have nothing to do without what others send.
constexpr std::array<std::string_view, 5> kListeners{"track_detector", "odometry", "map_matcher", "fusion",
                                                     "tpr_publisher"};

}  // namespace

std::vector<std::string> deaf_services(const Answers& answers) {
  std::vector<std::string> never;
  std::vector<std::string> no_more;
  for (const auto listener : kListeners) {
    const auto found = answers.find(std::string(listener));
    if (found == answers.end() || !found->second.healthy) continue;
    const auto& input_s = found->second.input_s;
    if (!input_s) never.emplace_back(listener);
    if (input_s && *input_s > kSilentS) no_more.emplace_back(listener);
  }
  const auto sentence = [](const std::vector<std::string>& deaf, const char* what) {
    return "running, but nothing " + std::string(what) + " has reached " + core::joined(deaf) +
           ": look at camera and sensors, and at domain, address and cable between the computers";
  };
  std::vector<std::string> told;
  if (!never.empty()) told.push_back(sentence(never, "yet"));
  if (!no_more.empty()) told.push_back(sentence(no_more, "for more than 5 s"));
  return told;
}

std::string standby_text(const PlannedService& service, const service::HealthAnswer& health) {
  if (!service.standby) return "";
  if (!health.healthy || health.starting) return " (configured as standby)";
  return health.stands_by ? " (standby)" : " (standby, in charge at present)";
}

std::string not_seen_from_here(const HostFolder& folder, const HostPlan& plan) {
  const auto settings = installed_settings(folder.generation(plan.generation));
  if (!settings || !settings.IsMap() || !settings["common"] || !settings["common"]["peers"]) return "";
  std::vector<std::string> others;
  for (const auto& peer : settings["common"]["peers"]) others.push_back(peer.Scalar());
  if (others.empty()) return "";
  return "not asked: the other computer" + std::string(others.size() == 1 ? " " : "s ") + core::joined(others) +
         "; railfix top --once shows which services of the whole train are heard here";
}

}  // namespace railfix::tool
