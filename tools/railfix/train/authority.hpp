// The certificate authority of a train, in FOLDER/security/authority. While it is exchanged there is a second one
// beside it: `next`, which signs nothing yet, or `former`, which signs nothing any more; every host trusts both.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/result.hpp"

namespace railfix::tool {

/// Everything is on the disk before anything depends on it, and what is broken off may be done once more.
class Authority {
 public:
  explicit Authority(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// All that a host trusts; the first one is the one that signs.
  [[nodiscard]] std::string trusted() const;
  [[nodiscard]] bool can_sign() const;
  [[nodiscard]] bool has_next() const;
  [[nodiscard]] bool has_former() const;

  /// The way in which keys are made that had begun and did not come to its end; empty = the usual one.
  [[nodiscard]] std::optional<std::string> broken_off() const;
  core::Status begin(const std::string& way) const;
  void end() const;

  core::Status make(const std::string& train_id) const { return make("ca", train_id); }
  /// Its key is lost: nothing can be signed until the next one takes over. Hosts that have what it signed trust it.
  core::Status remember(const std::filesystem::path& trusted_by_host) const;
  [[nodiscard]] core::Status may_make_next() const;
  core::Status make_next(const std::string& train_id) const { return make("next", train_id); }
  /// From now on the next one signs. REQUIRES: there is one.
  core::Status take_over() const;
  /// One that was broken off between its two renames.
  core::Status finish_take_over() const;
  [[nodiscard]] core::Status may_drop() const;
  core::Status drop() const;

  core::Status issue(const std::string& name, const std::filesystem::path& certificate_file,
                     const std::filesystem::path& key_file, int64_t valid_days) const;
  core::Status sign(const std::string& text, const std::filesystem::path& signed_file) const;

 private:
  [[nodiscard]] std::filesystem::path certificate(const std::string& name) const { return folder_ / (name + ".pem"); }
  [[nodiscard]] std::filesystem::path key(const std::string& name) const { return folder_ / (name + ".key.pem"); }
  core::Status make(const std::string& name, const std::string& train_id) const;
  std::filesystem::path folder_;
};

}  // namespace railfix::tool
