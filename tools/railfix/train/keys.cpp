#include "train/keys.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ctime>
#include <fstream>
#include <optional>
#include <set>

#include "core/joined.hpp"
#include "core/whole_file.hpp"
#include "train/render.hpp"
#include "train/topic_rights.hpp"

extern char** environ;

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kAuthorityDays = 7300;

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

std::string xml_time(std::time_t time) {
  char text[32];
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%S", &utc);
  return text;
}

/// Where the authority lives, and what is done with it. While it is exchanged there is a second one beside it: `next`,
/// which signs nothing yet, or `former`, which signs nothing any more; every host trusts both.
class Authority {
 public:
  explicit Authority(fs::path folder) : folder_(std::move(folder)) {}

  /// All that a host trusts; the first one is the one that signs.
  [[nodiscard]] std::string trusted() const {
    std::string text;
    for (const char* name : {"ca", "next", "former"}) {
      if (const auto file = core::read_whole(certificate(name)); file.ok()) text += file.value();
    }
    return text;
  }

  [[nodiscard]] bool can_sign() const { return fs::exists(certificate("ca")) && fs::exists(key("ca")); }
  core::Status make(const std::string& train_id) const { return make("ca", train_id); }
  /// Its key is lost: nothing can be signed until the next one takes over. Hosts that have what it signed trust it.
  core::Status remember(const fs::path& trusted_by_host) const {
    if (fs::exists(certificate("ca"))) return {};
    std::error_code failed;
    fs::create_directories(folder_, failed);
    fs::permissions(folder_, fs::perms::owner_all, failed);
    if (fs::copy_file(trusted_by_host, certificate("ca"), failed)) return {};
    return core::Error{certificate("ca").string() + " cannot be made of " + trusted_by_host.string()};
  }
  [[nodiscard]] bool has_next() const { return fs::exists(key("next")); }
  [[nodiscard]] bool has_former() const { return fs::exists(certificate("former")); }
  core::Status make_next(const std::string& train_id) const {
    if (fs::exists(certificate("next")))
      return core::Error{certificate("next").string() + " is there already; go on with " + keys_command() + " --renew"};
    if (fs::exists(certificate("former")))
      return core::Error{certificate("former").string() + " is still trusted; end that exchange with " +
                         keys_command() + " --drop-authority"};
    return make("next", train_id);
  }
  /// From now on the next one signs; false when there is none.
  [[nodiscard]] bool take_over() const {
    if (!fs::exists(certificate("next"))) return false;
    fs::rename(certificate("ca"), certificate("former"));
    fs::remove(key("ca"));
    fs::rename(key("next"), key("ca"));
    fs::rename(certificate("next"), certificate("ca"));
    return true;
  }
  core::Status drop() const {
    if (fs::remove(certificate("former"))) return {};
    if (has_next())
      return core::Error{"the next authority of " + folder_.string() +
                         " has signed nothing yet, so the former one is still needed: " + keys_command() +
                         " --renew, then railfix train upgrade on every host, come first"};
    return core::Error{"there is no former authority of " + folder_.string() + "; begin an exchange with " +
                       keys_command() + " --next-authority"};
  }

  core::Status issue(const std::string& name, const fs::path& certificate_file, const fs::path& key_file,
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
                      key("ca").string(), "-set_serial", "0x" + serial(), "-days", std::to_string(valid_days),
                      "-sha256", "-extfile", extensions.string(), "-out", certificate_file.string()});
    fs::remove(request);
    fs::remove(extensions);
    return status;
  }

  core::Status sign(const std::string& text, const fs::path& signed_file) const {
    const auto draft = folder_ / "draft.xml";
    auto status = core::write_whole(draft, text);
    if (!status.ok()) return status;
    status = openssl({"smime", "-sign", "-in", draft.string(), "-text", "-out", signed_file.string(), "-signer",
                      certificate("ca").string(), "-inkey", key("ca").string()});
    fs::remove(draft);
    return status;
  }

 private:
  [[nodiscard]] fs::path certificate(const std::string& name) const { return folder_ / (name + ".pem"); }
  // FOLDER/security/authority is ours.
  [[nodiscard]] std::string keys_command() const {
    return "railfix train keys " + folder_.parent_path().parent_path().string();
  }
  [[nodiscard]] fs::path key(const std::string& name) const { return folder_ / (name + ".key.pem"); }
  // All authorities of a train have one name: Fast DDS 2.9.1 refuses who got his permissions from one of another name.
  core::Status make(const std::string& name, const std::string& train_id) const {
    fs::create_directories(folder_);
    fs::permissions(folder_, fs::perms::owner_all);
    return openssl({"req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-sha256",
                    "-days", std::to_string(kAuthorityDays), "-subj", "/O=Railfix/CN=train " + train_id, "-keyout",
                    key(name).string(), "-out", certificate(name).string()});
  }
  static std::string serial() {
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
  fs::path folder_;
};

// A service's certificate, key and permissions in the folder of its host; false when they are there.
core::Result<bool> make_identity(const Manifest& manifest, const Authority& authority, const fs::path& folder,
                                 const std::string& service, const std::string& host, const KeysOptions& options) {
  const auto certificate = folder / (service + ".cert.pem");
  const auto key = folder / (service + ".key.pem");
  const auto permissions = folder / (service + ".permissions.p7s");
  if (fs::exists(certificate) && fs::exists(key) && fs::exists(permissions) && !options.renew) return false;
  auto status = authority.issue(service + "@" + host, certificate, key, options.valid_days);
  if (!status.ok()) return status.error();
  fs::permissions(key, fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  const std::time_t now = std::time(nullptr);
  status = authority.sign(
      permissions_xml(manifest, service, host, xml_time(now - 86400), xml_time(now + options.valid_days * 86400)),
      permissions);
  if (!status.ok()) return status.error();
  return true;
}

std::string topic_rule(const std::string& expression, bool protect) {
  const std::string kind = protect ? "ENCRYPT" : "NONE";
  return "        <topic_rule><topic_expression>" + expression + "</topic_expression>\n" +
         "          <enable_discovery_protection>" + (protect ? "true" : "false") + "</enable_discovery_protection>\n" +
         "          <enable_liveliness_protection>" + (protect ? "true" : "false") +
         "</enable_liveliness_protection>\n" +
         "          <enable_read_access_control>true</enable_read_access_control>\n" +
         "          <enable_write_access_control>true</enable_write_access_control>\n" +
         "          <metadata_protection_kind>" + kind + "</metadata_protection_kind>\n" +
         "          <data_protection_kind>NONE</data_protection_kind></topic_rule>\n";
}

std::string rights(const char* what, const std::vector<std::string>& topics, const std::string& partition) {
  std::string text = std::string("        <") + what + "><topics>\n";
  for (const auto& topic : topics) text += "          <topic>" + topic + "</topic>\n";
  return text + "        </topics><partitions><partition>" + partition + "</partition><partition>" + partition +
         "/memory/*</partition></partitions></" + what + ">\n";
}

std::string part_of(const std::string& text, const std::string& tag) {
  const auto begin = text.find("<" + tag + ">");
  const auto end = text.find("</" + tag + ">", begin);
  return end == std::string::npos ? "" : text.substr(begin, end - begin);
}

// Of every <tag>value</tag>.
std::set<std::string> values_in(const std::string& text, const std::string& tag) {
  const std::string begin = "<" + tag + ">";
  std::set<std::string> values;
  for (size_t at = 0; (at = text.find(begin, at)) != std::string::npos;) {
    at += begin.size();
    values.insert(text.substr(at, text.find('<', at) - at));
  }
  return values;
}

std::vector<std::string> missing_values(const std::string& wanted, const std::string& given, const std::string& tag,
                                        const std::string& say_before) {
  const auto have = values_in(given, tag);
  std::vector<std::string> missing;
  for (const auto& value : values_in(wanted, tag)) {
    if (!have.contains(value) && !have.contains("*")) missing.push_back(say_before + value);
  }
  return missing;
}

/// What a host of the train trusts already, if there is one: certificates have been made then.
std::optional<fs::path> trusted_by_a_host(const fs::path& security) {
  std::error_code none;
  for (const auto& host : fs::directory_iterator(security, none)) {
    const auto trusted = host.path() / "ca.pem";
    if (host.path().filename() != "authority" && fs::exists(trusted)) return trusted;
  }
  return std::nullopt;
}

/// An authority that can sign, or one that is about to be exchanged because its key is lost. Never another one
/// silently: its certificates would be strangers to the train that runs.
core::Status have_authority(const Authority& authority, const Manifest& manifest, const fs::path& folder,
                            const KeysOptions& options) {
  if (authority.can_sign()) return {};
  const auto trusted = trusted_by_a_host(folder);
  if (!trusted) return authority.make(manifest.train_id);
  if (options.next_authority || (options.renew && authority.has_next())) return authority.remember(*trusted);
  return core::Error{(folder / "authority/ca.key.pem").string() + " is not here, and " +
                     trusted->parent_path().string() +
                     " has certificates by that authority; run this where the train's keys were made, or copy " +
                     (folder / "authority").string() + " from there. If it is lost: railfix train keys " +
                     manifest.folder.string() + " --next-authority, which begins its exchange"};
}

}  // namespace

std::string governance_xml(const Manifest& manifest) {
  const std::string domain = std::to_string(manifest.domain);
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
         "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
         "xsi:noNamespaceSchemaLocation=\"governance.xsd\">\n"
         "  <domain_access_rules><domain_rule>\n    <domains><id>" +
         domain +
         "</id></domains>\n"
         "    <allow_unauthenticated_participants>false</allow_unauthenticated_participants>\n"
         "    <enable_join_access_control>true</enable_join_access_control>\n"
         "    <discovery_protection_kind>ENCRYPT</discovery_protection_kind>\n"
         "    <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>\n"
         "    <rtps_protection_kind>NONE</rtps_protection_kind>\n    <topic_access_rules>\n" +
         // Full pictures never leave the host; encrypted they could not be shared in memory.
         topic_rule("camera_frame/*", false) + topic_rule("*", true) +
         "    </topic_access_rules>\n  </domain_rule></domain_access_rules>\n</dds>\n";
}

std::string permissions_xml(const Manifest& manifest, const std::string& service, const std::string& host,
                            const std::string& not_before, const std::string& not_after) {
  const std::string partition = "train/" + manifest.train_id;
  std::vector<std::string> writes = topics_written_by_all();
  const auto& own = topics_written_by(service);
  writes.insert(writes.end(), own.begin(), own.end());
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
         "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
         "xsi:noNamespaceSchemaLocation=\"permissions.xsd\">\n"
         "  <permissions><grant name=\"" +
         service + "@" + host +
         "\">\n"
         "    <subject_name>CN=" +
         service + "@" + host +
         ",O=Railfix</subject_name>\n"
         "    <validity><not_before>" +
         not_before + "</not_before><not_after>" + not_after +
         "</not_after></validity>\n"
         "    <allow_rule><domains><id>" +
         std::to_string(manifest.domain) + "</id></domains>\n" + rights("publish", writes, partition) +
         rights("subscribe", topics_read_by(service), partition) +
         "    </allow_rule>\n    <default>DENY</default>\n  </grant></permissions>\n</dds>\n";
}

MissingRights missing_rights(const Manifest& manifest, const std::string& service, const std::string& host,
                             const fs::path& signed_file) {
  const auto file = core::read_whole(signed_file);  // the text stands readable before its signature
  const std::string given = file.ok() ? file.value() : "";
  const std::string wanted = permissions_xml(manifest, service, host, "", "");
  MissingRights missing{missing_values(wanted, given, "id", "domain "), {}};
  for (const std::string what : {"publish", "subscribe"}) {
    const auto wants = part_of(wanted, what);
    const auto has = part_of(given, what);
    if (missing.train.empty()) missing.train = missing_values(wants, has, "partition", "partition ");
    for (auto& topic : missing_values(wants, has, "topic", what + " ")) missing.topics.push_back(std::move(topic));
  }
  return missing;
}

core::Result<KeysDone> make_keys(const Manifest& manifest, const KeysOptions& options) {
  const fs::path folder = manifest.folder / "security";
  Authority authority(folder / "authority");
  KeysDone done;
  done.first = !authority.can_sign() && !trusted_by_a_host(folder);
  auto status = have_authority(authority, manifest, folder, options);
  if (status.ok() && options.next_authority) status = authority.make_next(manifest.train_id);
  if (status.ok() && options.drop_authority) status = authority.drop();
  if (!status.ok()) return status.error();
  if (options.renew) done.next_signs = authority.take_over();
  done.is_exchanging = authority.has_next() || authority.has_former();
  for (const auto& host : manifest.hosts) {
    const auto here = folder / host.name;
    fs::create_directories(here);
    status = core::write_whole(here / "ca.pem", authority.trusted());
    if (!status.ok()) return status.error();
    if (!authority.can_sign()) continue;  // what it has signed stays valid
    status = authority.sign(governance_xml(manifest), here / "governance.p7s");
    if (!status.ok()) return status.error();
    std::vector<std::string> services{kOperator, "onboard"};
    for (const auto& service : services_on(manifest, host.name)) services.push_back(service.name);
    for (const auto& service : services) {
      const auto made = make_identity(manifest, authority, here, service, host.name, options);
      if (!made.ok()) return made.error();
      done.certificates += made.value() ? 1 : 0;
    }
  }
  return done;
}

std::vector<std::string> told_of_keys(const Manifest& manifest, const KeysOptions& options, const KeysDone& done) {
  const std::string folder = manifest.folder.string();
  const std::string keys = "railfix train keys " + folder;
  const std::string count = std::to_string(done.certificates) + " certificates for " +
                            core::joined(manifest.hosts, &TrainHost::name) + ", in " + folder + "/security";
  std::vector<std::string> lines;
  if (done.first)
    lines.push_back("made: the train's authority; its key stays with you, in " + folder +
                    "/security/authority, and never goes to the train");
  if (options.next_authority) lines.emplace_back("made: a second authority, which every host is to trust from now on");
  if (options.drop_authority) lines.emplace_back("dropped: the former authority, which no host is to trust any more");
  if (options.renew) {
    lines.push_back("renewed: " + count + (done.next_signs ? ", by the next authority" : ""));
  } else if (done.certificates > 0) {
    lines.push_back("made: " + count);
  }
  if (lines.empty()) return {"nothing to do: all certificates are there; --renew makes new ones"};
  const std::string copy = "next: copy " + folder + " to each host (without security/authority), there railfix train ";
  if (options.next_authority) {
    lines.push_back(copy + "upgrade; when every host has done it: " + keys + " --renew");
  } else if (options.renew && done.is_exchanging) {
    lines.push_back(copy + "upgrade; when every host has done it: " + keys + " --drop-authority");
  } else {
    lines.push_back(copy + (options.renew || options.drop_authority ? "upgrade" : "up, or upgrade where it runs"));
  }
  return lines;
}

}  // namespace railfix::tool
