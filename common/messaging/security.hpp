// DDS Security (OMG DDS-SEC 1.1) of a train: who may join and which topics each service may write.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "core/result.hpp"

namespace railfix::messaging {

/// Environment variable with the folder of train.yaml on this computer, which a supervisor sets for its services.
inline constexpr const char* kTrainFolder = "RAILFIX_TRAIN_FOLDER";
/// `railfix train keys FOLDER` for the certificates in this folder, as an operator types it; TRAIN where nobody has
/// told this process which folder it is.
std::string keys_command(const std::filesystem::path& folder);

/// Fast DDS properties for the identity of `service` in this folder, which `railfix train keys` fills:
///   ca.pem, governance.p7s, <service>.cert.pem, <service>.key.pem, <service>.permissions.p7s
/// Tools, whose names begin with "railfix-", have the operator's identity `tool`.
/// Empty folder name: none. Error: a file that is missing or cannot be read.
core::Result<std::vector<std::pair<std::string, std::string>>> security_properties(const std::filesystem::path& folder,
                                                                                   const std::string& service);

/// Who is asked about certificates warns from this many days before the end on.
inline constexpr int64_t kCertificateWarningDays = 30;

/// The file of this process's certificate.
std::filesystem::path certificate_of(const std::filesystem::path& folder, const std::string& service);
/// When a certificate runs out. Error: no certificate.
core::Result<int64_t> certificate_ends_ns(const std::filesystem::path& certificate);
/// Days until then, negative when it has run out.
int64_t days_until(int64_t ends_ns);
core::Result<int64_t> days_left(const std::filesystem::path& certificate);
/// Error: `key` is no private key, asks for a password, or belongs to another certificate than this one.
core::Status key_fits(const std::filesystem::path& key, const std::filesystem::path& certificate);
/// Error: none of the authorities in this file has signed the certificate.
core::Status signed_by(const std::filesystem::path& authorities, const std::filesystem::path& certificate);
/// "runs out in 5 days", "ran out 2 days ago".
std::string end_text(int64_t days_left);

}  // namespace railfix::messaging
