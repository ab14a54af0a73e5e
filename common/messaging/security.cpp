#include "messaging/security.hpp"

#include <unistd.h>

namespace railfix::messaging {
core::Result<std::vector<std::pair<std::string, std::string>>> security_properties(const std::filesystem::path& folder,
                                                                                   const std::string& service) {
  std::vector<std::pair<std::string, std::string>> properties;
  if (folder.empty()) return properties;
  const std::string name = service.starts_with("railfix-") ? "tool" : service;
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

}  // namespace railfix::messaging
