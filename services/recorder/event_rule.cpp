#include "recorder/event_rule.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <regex>
#include <sstream>

#include "cdr/decode.hpp"
#include "core/joined.hpp"
#include "recorder/standing.hpp"

namespace railfix::recorder {

namespace {

using nlohmann::ordered_json;

constexpr std::array kOperations{"==", "!=", "<", "<=", ">", ">=", "has"};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

std::optional<double> number(const std::string& text) {
  double value = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

/// What the IDL calls the values of a member, in capitals: constants that its comment names, or "0 trace, 1 debug".
std::map<std::string, double> names_of(const std::string& type, const cdr::Member& member) {
  std::map<std::string, double> names;
  if (!member.constants.empty()) {
    const std::string prefix = type.substr(0, type.rfind("::") + 2) + member.constants;
    const auto& constants = cdr::own_types().constants();
    for (auto i = constants.lower_bound(prefix); i != constants.end() && i->first.starts_with(prefix); ++i) {
      names[i->first.substr(prefix.size())] = static_cast<double>(i->second);
    }
    return names;
  }
  static const std::regex kPair(R"((\d+) ([a-z]\w*))");
  for (std::sregex_iterator pair(member.comment.begin(), member.comment.end(), kPair), end; pair != end; ++pair) {
    names[upper(pair->str(2))] = std::stod(pair->str(1));
  }
  if (member.type.kind == cdr::Kind::boolean) names = {{"FALSE", 0}, {"TRUE", 1}};
  return names;
}

template <class T>
bool compare(const T& left, const std::string& operation, const T& right) {
  if (operation == "==") return left == right;
  if (operation == "!=") return left != right;
  if (operation == "<") return left < right;
  if (operation == "<=") return left <= right;
  if (operation == ">") return left > right;
  return left >= right;
}

bool holds(const ordered_json& value, const std::string& operation, const std::variant<double, std::string>& right) {
  if (const auto* text = std::get_if<std::string>(&right)) {
    if (!value.is_string()) return false;
    if (operation == "has") return value.get<std::string>().find(*text) != std::string::npos;
    return compare(value.get<std::string>(), operation, *text);
  }
  if (!value.is_number() && !value.is_boolean()) return false;
  const double left = value.is_boolean() ? static_cast<double>(value.get<bool>()) : value.get<double>();
  if (operation == "has") {
    const auto bits = static_cast<uint64_t>(std::get<double>(right));
    return bits != 0 && (value.get<uint64_t>() & bits) == bits;
  }
  return !std::isnan(left) && compare(left, operation, std::get<double>(right));
}

core::Error wrong(const std::string& rule, const std::string& what) {
  return core::Error{"the event rule '" + rule + "' " + what};
}

}  // namespace

core::Result<EventRule> EventRule::parse(const std::string& text,
                                         const std::function<std::string(const std::string& topic)>& type_of) {
  static const std::regex kForm(R"(\s*([\w/]+)(?:\.([\w.]+)\s*(==|!=|<=|>=|<|>|has\s)\s*(.*?))?\s*)");
  std::smatch part;
  if (!std::regex_match(text, part, kForm)) {
    return wrong(text, "is neither 'TOPIC.FIELD OP VALUE' nor 'TOPIC'; OP is one of " + core::joined(kOperations));
  }
  EventRule rule;
  rule.text_ = text;
  rule.topic_ = part[1];
  const std::string type = type_of(rule.topic_);
  if (type.empty()) return wrong(text, "names the topic '" + rule.topic_ + "', which there is not");
  if (!part[2].matched) return rule;
  const std::string operation = part.str(3).starts_with("has") ? "has" : part.str(3);
  const auto status = rule.set_condition(type, part[2], operation, part[4]);
  if (!status.ok()) return status.error();
  return rule;
}

core::Status EventRule::set_condition(const std::string& type, const std::string& field, const std::string& operation,
                                      const std::string& value) {
  path_ = split(field, '.');
  operation_ = operation;
  const cdr::Structure* structure = cdr::own_types().find(type);
  const cdr::Member* leaf = nullptr;
  size_t dimensions = 0;
  for (const auto& name : path_) {
    // Octets are decoded as one text.
    if (leaf != nullptr && dimensions > 0 && number(name) && leaf->type.kind != cdr::Kind::octet) {
      --dimensions;
      continue;
    }
    if (leaf != nullptr) structure = leaf->type.structure;
    if (structure == nullptr) return wrong(text_, "looks for '" + name + "' in " + leaf->name + ", which has no parts");
    const auto found = std::ranges::find(structure->members, name, &cdr::Member::name);
    if (found == structure->members.end()) {
      return wrong(text_, "names '" + name + "', but " + structure->name + " has " +
                              core::joined(structure->members, &cdr::Member::name));
    }
    leaf = &*found;
    dimensions = leaf->type.dimensions.size();
  }
  const bool list = dimensions > 0 || leaf->type.kind == cdr::Kind::sequence;
  if (list || leaf->type.kind == cdr::Kind::structure) {
    return wrong(text_, "compares " + leaf->name + ", which is more than one value; name one of them");
  }
  if (leaf->type.kind == cdr::Kind::text) {
    value_ = value;
    return {};
  }
  const auto names = names_of(structure->name, *leaf);
  if (const auto named = names.find(upper(value)); named != names.end()) {
    value_ = named->second;
  } else if (const auto plain = number(value)) {
    value_ = *plain;
  } else {
    const std::string known = core::joined(names, [](const auto& name) { return name.first; });
    return wrong(text_, "compares " + leaf->name + " with '" + value + "', which is no number" +
                            (known.empty() ? "" : " and none of " + known));
  }
  return {};
}

bool EventRule::concerns(const std::string& topic) const {
  return topic == topic_ || topic.substr(0, topic.find('/')) == topic_;
}

bool EventRule::begins(const StoredSample& sample) {
  if (path_.empty()) return true;
  const auto decoded = cdr::decode(cdr::own_types(), sample.channel->type, sample.cdr);
  if (!decoded.ok()) return false;
  const ordered_json* value = &decoded.value();
  for (const auto& name : path_) {
    if (value->is_array()) {
      const auto index = static_cast<size_t>(number(name).value_or(-1));
      if (index >= value->size()) return false;
      value = &(*value)[index];
    } else {
      if (!value->contains(name)) return false;
      value = &(*value)[name];
    }
  }
  const bool now = holds(*value, operation_, value_);
  if (is_said_once(sample.channel->topic)) return now;
  const std::string key = key_of(*sample.channel, decoded.value());
  if (!now) {
    fulfilled_.erase(key);
    return false;
  }
  return fulfilled_.insert(key).second;
}

}  // namespace railfix::recorder
