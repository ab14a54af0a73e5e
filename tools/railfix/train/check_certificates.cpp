// Certificates, keys and permissions of a train: what is missing, runs out, or was made for another manifest.
#include <unistd.h>

#include <map>

#include "core/joined.hpp"
#include "messaging/security.hpp"
#include "train/findings.hpp"
#include "train/keys.hpp"
#include "train/setting_files.hpp"
#include "train/topic_rights.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRenewElsewhere = "; get a new one, put it there, then railfix train upgrade on each host";
constexpr const char* kOtherKey = "; put there the one that the certificate was made with";
constexpr const char* kOneMaking = "; copy the whole folder anew from where the train's keys were made";

/// What is to be done with the train's own certificates, as it is to be typed.
struct Remedies {
  explicit Remedies(const std::string& train)
      : authority("; exchange the authority, beginning with railfix train keys " + train + " --next-authority"),
        renew("; railfix train keys " + train + " --renew, then railfix train upgrade on each host"),
        renew_train("; railfix train keys " + train + " --renew, then railfix train down on every host, then up") {}
  std::string authority;
  std::string renew;
  std::string renew_train;
};

int64_t warning_days(const YAML::Node& settings) {
  int64_t days = messaging::kCertificateWarningDays;
  if (!settings || !settings.IsMap()) return days;
  const YAML::Node section = settings["monitor"];
  if (section && section.IsMap() && section["certificate_days"])
    (void)YAML::convert<int64_t>::decode(section["certificate_days"], days);
  return days;
}

void check_end(const fs::path& certificate, int64_t soon_days, const std::string& remedy, Findings& findings) {
  const auto left = messaging::days_left(certificate);
  if (!left.ok()) {
    add_once(findings, {true, left.error().message});
  } else if (left.value() < soon_days) {
    add_once(findings, {left.value() < 0, certificate.string() + " " + messaging::end_text(left.value()) + remedy});
  }
}

void check_key(const fs::path& key, const fs::path& certificate, const std::string& setting, const std::string& remedy,
               Findings& findings) {
  if (!messaging::days_left(certificate).ok()) return;  // told already
  if (const auto fits = messaging::key_fits(key, certificate); !fits.ok())
    add_once(findings, {true, setting + fits.error().message + remedy});
}

/// Everything that DDS asks for when this service joins. False when a file is missing.
bool check_identity(const fs::path& folder, const std::string& service, int64_t soon_days, const Remedies& remedies,
                    Findings& findings) {
  if (const auto files = messaging::security_properties(folder, service); !files.ok()) {
    add_once(findings, {true, files.error().message});
    return false;
  }
  check_end(folder / "ca.pem", soon_days, remedies.authority, findings);
  const auto certificate = messaging::certificate_of(folder, service);
  check_end(certificate, soon_days, remedies.renew, findings);
  check_key(folder / (service + ".key.pem"), certificate, "", remedies.renew, findings);
  if (messaging::days_left(certificate).ok() && messaging::days_left(folder / "ca.pem").ok()) {
    if (const auto issued = messaging::signed_by(folder / "ca.pem", certificate); !issued.ok())
      add_once(findings, {true, issued.error().message + kOneMaking});
  }
  return true;
}

/// Certificates that somebody else has made: the broker's authority, the train's name there, the page's. Of several in
/// one file the first counts.
void check_named_certificates(const YAML::Node& settings, const fs::path& folder, const std::string& service,
                              Findings& findings) {
  for (const auto& named : certificate_files(settings)) {
    const auto file = folder / named.file;  // an absolute one stays so
    if (named.service != service || !fs::exists(file)) continue;
    if (messaging::days_left(file).ok()) {
      check_end(file, warning_days(settings), kRenewElsewhere, findings);
    } else {
      add_once(findings,
               {true, "settings." + service + "." + named.key + ": " + file.string() + " is not a certificate in PEM"});
    }
  }
}

/// Their private keys, as far as this user may read them.
void check_named_keys(const YAML::Node& settings, const fs::path& folder, const std::string& service,
                      Findings& findings) {
  for (const auto& named : key_files(settings)) {
    const auto file = folder / named.key.file;
    if (named.key.service != service || access(file.c_str(), R_OK) != 0) continue;
    check_key(file, folder / named.certificate, "settings." + service + "." + named.key.key + ": ", kOtherKey,
              findings);
  }
}

void check_named_files(const YAML::Node& settings, const fs::path& folder, const std::string& service,
                       Findings& findings) {
  check_named_certificates(settings, folder, service, findings);
  check_named_keys(settings, folder, service, findings);
}

/// What permissions do not allow, and of which services.
using Forbidden = std::map<std::string, std::vector<std::string>>;

/// Permissions that were made before the train got another domain or name let nobody in (and no upgrade would bring it
/// there, because old and new services do not hear each other); those of a release whose service used fewer topics
/// leave a topic silent.
void check_permissions(const Manifest& manifest, const std::string& host, const std::string& service,
                       const fs::path& file, const Remedies& remedies, Forbidden& forbidden, Findings& findings) {
  const auto missing = missing_rights(manifest, service, host, file);
  if (!missing.train.empty()) {
    forbidden[core::joined(missing.train)].push_back(service);
  } else if (!missing.topics.empty()) {
    add_once(findings,
             {false, file.string() + " does not allow what " + service +
                         " of release " RAILFIX_VERSION " does: " + core::joined(missing.topics) + remedies.renew});
  }
}

void check_keys(const Manifest& manifest, const TrainHost& host, Findings& findings) {
  const auto folder = manifest.folder / "security" / host.name;
  if (!fs::exists(folder))  // one reason, one sentence
    return findings.push_back(
        {true,
         folder.string() + " is missing; make the train's certificates with railfix train keys " + manifest.typed()});
  std::vector<std::string> services{kOperator};
  for (const auto& service : services_on(manifest, host.name)) services.push_back(service.name);
  const Remedies remedies(manifest.typed());
  Forbidden forbidden;
  for (const auto& service : services) {
    if (check_identity(folder, service, warning_days(manifest.settings), remedies, findings))
      check_permissions(manifest, host.name, service, folder / (service + ".permissions.p7s"), remedies, forbidden,
                        findings);
  }
  for (const auto& [what, of] : forbidden)
    error(findings, folder.string() + ": " + std::to_string(of.size()) + " of " + std::to_string(services.size()) +
                        " permissions do not allow " + what + " (" + core::joined(of) + ")" + remedies.renew_train);
}

}  // namespace

std::vector<Finding> check_certificates(const Manifest& manifest, const TrainHost& host) {
  Findings findings;
  if (manifest.security) check_keys(manifest, host, findings);
  for (const auto& service : services_on(manifest, host.name))
    check_named_files(manifest.settings, manifest.folder, service.name, findings);
  return findings;
}

std::vector<Finding> check_installed_certificates(const HostFolder& folder) {
  Findings findings;
  const auto plan = folder.plan();
  if (!plan) return findings;
  for (const auto& service : plan->services) {
    const auto generation = folder.generation(service.generation);
    const auto settings = installed_settings(generation);
    if (fs::exists(generation / "security"))
      check_identity(generation / "security", service.name, warning_days(settings), Remedies(plan->train()), findings);
    check_named_files(settings, generation, service.name, findings);
  }
  return findings;
}

}  // namespace railfix::tool
