// The manifest as files for each host: the services' configuration, maps and keys, a compose file, the supervisor's
// unit.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "train/containers.hpp"

namespace railfix::tool {

/// Where the recorder writes that was told nothing else: in the folder that services run in, so below --root.
inline constexpr const char* kUsualRecordings = "recordings";

std::vector<HostedService> services_on(const Manifest& manifest, const std::string& host);

/// Of a service, beside its configuration.
std::vector<std::string> service_arguments(const HostedService& service);

/// Fills `folder` with everything that this host needs: config.yaml, map, calibration, qos profiles, security/,
/// compose.yaml, systemd/railfix.service, systemd/60-railfix.conf. Keys and passwords that were rendered there before
/// go. Error: a file that cannot be copied or written.
core::Status render_host(const Manifest& manifest, const TrainHost& host, const std::filesystem::path& folder);
/// Removes them from what was rendered into other folders of `out`, for hosts that this train has not. Gives these.
std::vector<std::filesystem::path> remove_secrets_of_others(const Manifest& manifest, const std::filesystem::path& out);

/// The configuration of all services on this host, for files that lie in `folder` there.
std::string render_config(const Manifest& manifest, const TrainHost& host, const std::string& folder);
std::string render_compose(const Manifest& manifest, const TrainHost& host, const std::string& folder);

/// Where this computer has the program: ROOT/opt/railfix/RELEASE/bin, or beside this one when it is of that release.
std::optional<std::filesystem::path> program_of(const HostedService& service, const std::filesystem::path& root);
/// What starts one service whose files lie in `folder`. Error: there is no such program.
core::Result<std::vector<std::string>> program_command(const HostedService& service,
                                                       const std::filesystem::path& folder,
                                                       const std::filesystem::path& root);
/// Everything that the service reads, as text: another text means that it must be restarted.
std::string settings_of(const Manifest& manifest, const TrainHost& host, const std::string& service);

}  // namespace railfix::tool
