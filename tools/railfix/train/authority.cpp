#include "train/authority.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <vector>

#include "core/whole_file.hpp"
#include "messaging/security.hpp"
#include "train/whole_folder.hpp"

extern char** environ;

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kAuthorityDays = 7300;
constexpr const char* kUnfinished = "unfinished";

core::Status openssl(const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>("openssl")};
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, STDERR_FILENO, "/dev/null", 1, 0);
  pid_t pid = -1;
  const int failed = posix_spawnp(&pid, "openssl", &quiet, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&quiet);
  if (failed != 0) return core::Error{"openssl is missing; install the Debian package openssl"};
  int status = 0;
  waitpid(pid, &status, 0);
  if (status == 0) return {};
  return core::Error{"openssl " + arguments.front() + " failed; run it by hand to see why: openssl " + [&] {
    std::string line;
    for (const auto& argument : arguments) line += argument + " ";
    return line;
  }()};
}

std::string serial() {
  std::ifstream random("/dev/urandom", std::ios::binary);
  std::string hex = "1";
  for (int i = 0; i < 15; ++i) {
    const int byte = random.get() & 0xff;
    constexpr char kDigits[] = "0123456789abcdef";
    hex += kDigits[byte >> 4];
    hex += kDigits[byte & 15];
  }
  return hex;
}

}  // namespace

std::string Authority::trusted() const {
  std::string text;
  for (const char* name : {"ca", "next", "former"}) {
    if (const auto file = core::read_whole(certificate(name)); file.ok()) text += file.value();
  }
  return text;
}

bool Authority::can_sign() const {
  return fs::exists(certificate("ca")) && fs::exists(key("ca"));
}

bool Authority::has_next() const {
  return fs::exists(certificate("next")) && fs::exists(key("next"));
}

bool Authority::has_former() const {
  return fs::exists(certificate("former"));
}

std::optional<std::string> Authority::broken_off() const {
  const auto way = core::read_whole(folder_ / kUnfinished);
  if (!way.ok()) return std::nullopt;
  return way.value();
}

core::Status Authority::begin(const std::string& way) const {
  std::error_code failed;
  fs::create_directories(folder_, failed);
  fs::permissions(folder_, fs::perms::owner_all, failed);
  auto written = core::write_whole(folder_ / kUnfinished, way);
  to_disk(folder_);
  return written;
}

void Authority::end() const {
  std::error_code failed;
  fs::remove(folder_ / kUnfinished, failed);
  to_disk(folder_);
}

core::Status Authority::remember(const fs::path& trusted_by_host) const {
  if (fs::exists(certificate("ca"))) return {};
  const auto text = core::read_whole(trusted_by_host);
  if (!text.ok()) return text.error();
  return core::write_whole(certificate("ca"), text.value());
}

core::Status Authority::may_make_next() const {
  if (fs::exists(certificate("next")))
    return core::Error{certificate("next").string() + " is there already; go on with " +
                       messaging::keys_command(folder_) + " --renew"};
  if (has_former())
    return core::Error{certificate("former").string() + " is still trusted; end that exchange with " +
                       messaging::keys_command(folder_) + " --drop-authority"};
  return {};
}

// Between the two moves the certificate is the old one and the key the new one: finish_take_over() knows that by them.
core::Status Authority::take_over() const {
  const auto before = core::read_whole(certificate("ca"));
  if (!before.ok()) return before.error();
  auto status = core::write_whole(certificate("former"), before.value());
  to_disk(folder_);
  if (status.ok()) status = core::move_draft(key("next"), key("ca"));
  if (status.ok()) status = core::move_draft(certificate("next"), certificate("ca"));
  to_disk(folder_);
  return status;
}

core::Status Authority::finish_take_over() const {
  if (fs::exists(key("next")) || !messaging::key_fits(key("ca"), certificate("next")).ok()) return {};
  return core::move_draft(certificate("next"), certificate("ca"));
}

core::Status Authority::may_drop() const {
  if (has_former()) return {};
  if (has_next())
    return core::Error{
        "the next authority of " + folder_.string() + " has signed nothing yet, so the former one is still needed: " +
        messaging::keys_command(folder_) + " --renew, then railfix train upgrade on every host, come first"};
  return core::Error{"there is no former authority of " + folder_.string() + "; begin an exchange with " +
                     messaging::keys_command(folder_) + " --next-authority"};
}

core::Status Authority::drop() const {
  std::error_code failed;
  fs::remove(certificate("former"), failed);
  if (!failed) return {};
  return core::Error{certificate("former").string() + " cannot be removed: " + failed.message()};
}

core::Status Authority::issue(const std::string& name, const fs::path& certificate_file, const fs::path& key_file,
                              int64_t valid_days) const {
  const auto request = folder_ / "request.pem";
  auto status = openssl({"req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-sha256",
                         "-subj", "/O=Railfix/CN=" + name, "-keyout", key_file.string(), "-out", request.string()});
  if (!status.ok()) return status;
  // By name alone nobody could tell which of two authorities has signed.
  const auto extensions = folder_ / "extensions";
  status = core::write_whole(extensions, "authorityKeyIdentifier=keyid:always\n");
  if (!status.ok()) return status;
  status = openssl({"x509", "-req", "-in", request.string(), "-CA", certificate("ca").string(), "-CAkey",
                    key("ca").string(), "-set_serial", "0x" + serial(), "-days", std::to_string(valid_days), "-sha256",
                    "-extfile", extensions.string(), "-out", certificate_file.string()});
  fs::remove(request);
  fs::remove(extensions);
  return status;
}

core::Status Authority::sign(const std::string& text, const fs::path& signed_file) const {
  const auto draft = folder_ / "draft.xml";
  auto status = core::write_whole(draft, text);
  if (!status.ok()) return status;
  status = openssl({"smime", "-sign", "-in", draft.string(), "-text", "-out", signed_file.string(), "-signer",
                    certificate("ca").string(), "-inkey", key("ca").string()});
  fs::remove(draft);
  return status;
}

// All authorities of a train have one name: Fast DDS 2.9.1 refuses who got his permissions from one of another name.
core::Status Authority::make(const std::string& name, const std::string& train_id) const {
  const auto new_key = folder_ / "draft.key.pem";
  const auto new_certificate = folder_ / "draft.pem";
  auto status = openssl({"req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                         "-sha256", "-days", std::to_string(kAuthorityDays), "-subj", "/O=Railfix/CN=train " + train_id,
                         "-keyout", new_key.string(), "-out", new_certificate.string()});
  to_disk(folder_);
  if (status.ok()) status = core::move_draft(new_key, key(name));
  if (status.ok()) status = core::move_draft(new_certificate, certificate(name));
  to_disk(folder_);
  return status;
}

}  // namespace railfix::tool
