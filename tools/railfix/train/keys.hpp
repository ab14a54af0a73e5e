// Keys of a train: its own certificate authority, one certificate and one permission file for each service on each host
// (OMG DDS-SEC 1.1, 8.3 and 8.4). Made with the openssl program.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "train/manifest.hpp"

namespace railfix::tool {

struct KeysOptions {
  int64_t valid_days = 365;
  bool renew = false;           // new certificates, by the next authority if there is one; the old ones stay valid
  bool next_authority = false;  // a second one, which everybody trusts from now on
  bool drop_authority = false;  // the former one is trusted no more
};

/// Governance and permissions as XML, before they are signed.
std::string governance_xml(const Manifest& manifest);
std::string permissions_xml(const Manifest& manifest, const std::string& service, const std::string& host,
                            const std::string& not_before, const std::string& not_after);

struct MissingRights {
  std::vector<std::string> train;   // its domain and name: without them nobody is let in
  std::vector<std::string> topics;  // "publish train_state"
};
/// What a signed file of permissions does not give of those that would be made now. What it gives beyond is no matter.
MissingRights missing_rights(const Manifest& manifest, const std::string& service, const std::string& host,
                             const std::filesystem::path& signed_file);

/// What make_keys() has done.
struct KeysDone {
  size_t certificates = 0;     // made, or made anew
  bool first = false;          // with a new authority
  bool next_signs = false;     // the next authority has taken over; the former one is still trusted
  bool is_exchanging = false;  // two authorities are trusted
  bool resumed = false;        // one that was broken off before is done now
};

/// Fills FOLDER/security/<host>/ for every host and FOLDER/security/authority/ with the authority, whose key stays with
/// the operator. What is there stays unless it is renewed. Broken off at any moment (a kill, a power cut) it leaves
/// every host with all of its old files or all of its new ones, and the same again does the rest. Error: openssl is
/// missing or refuses; an exchange of the authority out of turn; another one that was broken off comes first.
core::Result<KeysDone> make_keys(const Manifest& manifest, const KeysOptions& options);
/// What was done and what comes next, for the operator: a line each.
std::vector<std::string> told_of_keys(const Manifest& manifest, const KeysOptions& options, const KeysDone& done);

}  // namespace railfix::tool
