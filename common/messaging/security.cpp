#include "messaging/security.hpp"

#include <openssl/asn1.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <unistd.h>

#include <cstdio>
#include <memory>

namespace railfix::messaging {

namespace {

std::string identity_of(const std::string& service) {
  return service.starts_with("railfix-") ? "tool" : service;
}

}  // namespace

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
                         "`railfix train keys` and copy this host's part here"};
    }
    properties.emplace_back(property, "file://" + file.string());
  }
  return properties;
}

core::Result<int64_t> days_left(const std::filesystem::path& certificate) {
  const std::unique_ptr<FILE, int (*)(FILE*)> file(std::fopen(certificate.c_str(), "r"),
                                                   [](FILE* f) { return f != nullptr ? std::fclose(f) : 0; });
  if (!file) return core::Error{certificate.string() + " is missing; make it with railfix train keys"};
  const std::unique_ptr<X509, void (*)(X509*)> read(PEM_read_X509(file.get(), nullptr, nullptr, nullptr), X509_free);
  if (!read)
    return core::Error{certificate.string() + " is not a certificate; make it again with railfix train keys --renew"};
  int days = 0;
  int seconds = 0;
  if (ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(read.get())) != 1)
    return core::Error{certificate.string() + " has no readable end of validity"};
  return seconds < 0 ? days - 1 : days;
}

}  // namespace railfix::messaging
