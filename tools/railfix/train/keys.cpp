#include "train/keys.hpp"

#include <ctime>
#include <fstream>
#include <optional>
#include <set>

#include "core/joined.hpp"
#include "core/whole_file.hpp"
#include "messaging/security.hpp"
#include "train/authority.hpp"
#include "train/render.hpp"
#include "train/topic_rights.hpp"
#include "train/whole_folder.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

std::string xml_time(std::time_t time) {
  char text[32];
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%S", &utc);
  return text;
}

// A service's certificate, key and permissions in the folder of its host; false when they are there and fit.
core::Result<bool> make_identity(const Manifest& manifest, const Authority& authority, const fs::path& folder,
                                 const std::string& service, const std::string& host, const KeysOptions& options) {
  const auto certificate = folder / (service + ".cert.pem");
  const auto key = folder / (service + ".key.pem");
  const auto permissions = folder / (service + ".permissions.p7s");
  const bool there = fs::exists(permissions) && messaging::key_fits(key, certificate).ok();
  if (there && !options.renew) return false;
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
    const auto name = host.path().filename().string();
    if (name != "authority" && !name.starts_with('.') && fs::exists(trusted)) return trusted;
  }
  return std::nullopt;
}

/// As an operator types it.
std::string flag_of(const KeysOptions& options) {
  return options.renew            ? "--renew"
         : options.next_authority ? "--next-authority"
         : options.drop_authority ? "--drop-authority"
                                  : "";
}

std::string keys_command(const Manifest& manifest, const std::string& flag) {
  return messaging::keys_command(manifest.folder / "security/authority") + (flag.empty() ? "" : " " + flag);
}

/// Error: an exchange of the authority out of turn; or there is no authority that can sign, nor one that is about to be
/// exchanged because its key is lost. Never another one silently: its certificates would be strangers to the train that
/// runs.
core::Status in_turn(const Authority& authority, const Manifest& manifest, const fs::path& folder,
                     const KeysOptions& options) {
  const auto trusted = trusted_by_a_host(folder);
  const bool is_exchanged = options.next_authority || (options.renew && authority.has_next());
  if (!authority.can_sign() && trusted && !is_exchanged)
    return core::Error{
        (folder / "authority/ca.key.pem").string() + " is not here, and " + trusted->parent_path().string() +
        " has certificates by that authority; run this where the train's keys were made, or copy " +
        (folder / "authority").string() + " from there. If it is lost: " + keys_command(manifest, "--next-authority") +
        ", which begins its exchange"};
  if (options.next_authority) return authority.may_make_next();
  if (options.drop_authority) return authority.may_drop();
  return {};
}

/// What is done with the authority itself, before its hosts' part; done again it changes nothing.
core::Status change_authority(const Authority& authority, const Manifest& manifest, const fs::path& folder,
                              const KeysOptions& options, KeysDone& done) {
  const auto trusted = trusted_by_a_host(folder);
  core::Status status;
  if (!authority.can_sign()) status = trusted ? authority.remember(*trusted) : authority.make(manifest.train_id);
  if (status.ok() && options.next_authority && !authority.has_next()) status = authority.make_next(manifest.train_id);
  if (status.ok() && options.drop_authority) status = authority.drop();
  done.next_signs = options.renew && authority.has_next();
  if (status.ok() && done.next_signs) status = authority.take_over();
  done.is_exchanging = authority.has_next() || authority.has_former();
  return status;
}

/// Everything of one host, as one: with an interruption it has its old files or its new ones.
core::Status make_host(const Manifest& manifest, const Authority& authority, const std::string& host,
                       const fs::path& folder, const KeysOptions& options, KeysDone& done) {
  const auto draft = draft_of_folder(folder);
  if (!draft.ok()) return draft.error();
  const auto& here = draft.value();
  auto status = core::write_whole(here / "ca.pem", authority.trusted());
  if (!status.ok()) return status;
  if (!authority.can_sign()) return replace_folder(here, folder);  // what it has signed stays valid
  status = authority.sign(governance_xml(manifest), here / "governance.p7s");
  if (!status.ok()) return status;
  std::vector<std::string> services{kOperator, "onboard"};
  for (const auto& service : services_on(manifest, host)) services.push_back(service.name);
  for (const auto& service : services) {
    const auto made = make_identity(manifest, authority, here, service, host, options);
    if (!made.ok()) return made.error();
    done.certificates += made.value() ? 1 : 0;
  }
  return replace_folder(here, folder);
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
  const Authority authority(folder / "authority");
  const auto flag = flag_of(options);
  const auto broken_off = authority.broken_off();
  KeysDone done;
  done.resumed = broken_off.has_value();
  // The steps after it would take hosts out of the train that it had not come to.
  if (done.resumed && !broken_off->empty() && *broken_off != flag)
    return core::Error{keys_command(manifest, *broken_off) +
                       " was broken off and is done in part; type it again first"};
  done.first = !trusted_by_a_host(folder) && (done.resumed || !authority.can_sign());
  auto status = authority.finish_take_over();
  if (status.ok() && !(done.resumed && *broken_off == flag && !flag.empty()))
    status = in_turn(authority, manifest, folder, options);
  if (status.ok()) status = authority.begin(flag);
  if (status.ok()) status = change_authority(authority, manifest, folder, options, done);
  for (const auto& host : manifest.hosts) {
    if (status.ok()) status = make_host(manifest, authority, host.name, folder / host.name, options, done);
  }
  if (!status.ok()) return status.error();
  authority.end();
  return done;
}

std::vector<std::string> told_of_keys(const Manifest& manifest, const KeysOptions& options, const KeysDone& done) {
  const std::string folder = manifest.folder.string();
  const std::string keys = keys_command(manifest, "");
  const std::string count = std::to_string(done.certificates) + " certificates for " +
                            core::joined(manifest.hosts, &TrainHost::name) + ", in " + folder + "/security";
  std::vector<std::string> lines;
  if (done.resumed)
    lines.push_back("repaired: " + keys_command(manifest, flag_of(options)) + " had been broken off; it is done now");
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
