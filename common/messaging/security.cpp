#include "messaging/security.hpp"

#include <openssl/asn1.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>

#include "core/shell_word.hpp"
#include "core/time.hpp"

namespace railfix::messaging {

namespace {

std::string identity_of(const std::string& service) {
  return service.starts_with("railfix-") ? "tool" : service;
}

/// What `read` makes of a PEM file; nullptr when the file cannot be read.
template <class Read>
auto read_pem(const std::filesystem::path& path, Read read) -> decltype(read(nullptr)) {
  FILE* file = std::fopen(path.c_str(), "r");
  if (file == nullptr) return nullptr;
  auto* found = read(file);
  std::fclose(file);
  return found;
}

using Certificate = std::unique_ptr<X509, void (*)(X509*)>;
using PrivateKey = std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)>;

Certificate read_certificate(const std::filesystem::path& path) {
  return {read_pem(path, [](FILE* file) { return PEM_read_X509(file, nullptr, nullptr, nullptr); }), X509_free};
}

PrivateKey read_key(const std::filesystem::path& path) {
  constexpr auto kNoPassword = [](char*, int, int, void*) { return -1; };
  return {read_pem(path, [&](FILE* file) { return PEM_read_PrivateKey(file, nullptr, kNoPassword, nullptr); }),
          EVP_PKEY_free};
}

}  // namespace

std::string keys_command(const std::filesystem::path& folder) {
  const auto train = folder.parent_path().parent_path();  // TRAIN/security/HOST
  std::error_code none;
  const char* told = std::getenv(kTrainFolder);
  const bool is_told = told != nullptr && *told != '\0';
  const bool is_in_it = !train.empty() && std::filesystem::exists(train / "train.yaml", none);
  return "railfix train keys " + (is_in_it || is_told ? core::shell_word(is_in_it ? train.string() : told) : "TRAIN");
}

core::Result<std::vector<std::pair<std::string, std::string>>> security_properties(const std::filesystem::path& folder,
                                                                                   const std::string& service) {
  std::vector<std::pair<std::string, std::string>> properties;
  if (folder.empty()) return properties;
  const std::string name = identity_of(service);
  const std::string identity = "dds.sec.auth.builtin.PKI-DH.";
  const std::string permissions = "dds.sec.access.builtin.Access-Permissions.";
  properties = {{"dds.sec.auth.plugin", "builtin.PKI-DH"},
                {"dds.sec.access.plugin", "builtin.Access-Permissions"},
                {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}};
  const std::vector<std::pair<std::string, std::string>> files{
      {identity + "identity_ca", "ca.pem"},           {identity + "identity_certificate", name + ".cert.pem"},
      {identity + "private_key", name + ".key.pem"},  {permissions + "permissions_ca", "ca.pem"},
      {permissions + "governance", "governance.p7s"}, {permissions + "permissions", name + ".permissions.p7s"}};
  for (const auto& [property, file_name] : files) {
    const auto file = std::filesystem::absolute(folder / file_name);
    if (access(file.c_str(), R_OK) != 0) {
      return core::Error{file.string() + " is missing or cannot be read by this user; make the train's keys with " +
                         keys_command(folder) +
                         ", on the computer that has security/authority, and copy this host's part here"};
    }
    properties.emplace_back(property, "file://" + file.string());
  }
  return properties;
}

std::filesystem::path certificate_of(const std::filesystem::path& folder, const std::string& service) {
  return folder / (identity_of(service) + ".cert.pem");
}

core::Result<int64_t> certificate_ends_ns(const std::filesystem::path& certificate) {
  if (access(certificate.c_str(), R_OK) != 0)
    return core::Error{certificate.string() + " is missing; make it with " + keys_command(certificate.parent_path())};
  const auto read = read_certificate(certificate);
  if (!read)
    return core::Error{certificate.string() + " is not a certificate; make it again with " +
                       keys_command(certificate.parent_path()) + " --renew"};
  std::tm ends{};
  if (ASN1_TIME_to_tm(X509_get0_notAfter(read.get()), &ends) != 1)
    return core::Error{certificate.string() + " has no readable end of validity"};
  return timegm(&ends) * core::kNsPerSecond;
}

core::Status key_fits(const std::filesystem::path& key, const std::filesystem::path& certificate) {
  const auto own = read_key(key);
  if (!own) return core::Error{key.string() + " is not a private key in PEM without password"};
  const auto of = read_certificate(certificate);
  if (of && X509_check_private_key(of.get(), own.get()) == 1) return {};
  return core::Error{key.string() + " is not the private key of " + certificate.string()};
}

core::Status signed_by(const std::filesystem::path& authorities, const std::filesystem::path& certificate) {
  const auto issued = read_certificate(certificate);
  const auto issuer = read_pem(authorities, [&](FILE* file) {
    Certificate authority{nullptr, X509_free};
    do {
      authority.reset(PEM_read_X509(file, nullptr, nullptr, nullptr));
    } while (authority && issued && X509_verify(issued.get(), X509_get0_pubkey(authority.get())) != 1);
    return authority.release();
  });
  const Certificate found{issuer, X509_free};
  if (issued && found) return {};
  return core::Error{certificate.string() + " was not signed by the authority in " + authorities.string()};
}

int64_t days_until(int64_t ends_ns) {
  constexpr int64_t kDayNs = 86'400 * core::kNsPerSecond;
  const int64_t left_ns = ends_ns - core::wall_ns();
  return left_ns / kDayNs - (left_ns % kDayNs < 0 ? 1 : 0);
}

std::string end_text(int64_t days_left) {
  return days_left < 0 ? "ran out " + std::to_string(-days_left) + " days ago"
                       : "runs out in " + std::to_string(days_left) + " days";
}

core::Result<int64_t> days_left(const std::filesystem::path& certificate) {
  const auto ends_ns = certificate_ends_ns(certificate);
  if (!ends_ns.ok()) return ends_ns.error();
  return days_until(ends_ns.value());
}

}  // namespace railfix::messaging
