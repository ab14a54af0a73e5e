#include "service/config.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <sstream>

#include "core/joined.hpp"
#include "core/similar_names.hpp"
#include "service/yaml_file.hpp"

namespace railfix::service {
namespace {

// 16777215, not 1.67772e+07.
std::string number_text(double value) {
  constexpr double kWholeBelow = 1e15;
  std::ostringstream text;
  if (std::abs(value) < kWholeBelow && value == std::trunc(value)) {
    text << static_cast<int64_t>(value);
  } else {
    text << value;
  }
  return text.str();
}

std::string range_text(Range range) {
  return number_text(range.min) + " to " + number_text(range.max);
}

// Fills the fields of one YAML mapping; collects everything that is wrong instead of stopping at the first.
class Reader final : public Fields {
 public:
  Reader(const YAML::Node& node, std::string path, std::string file, std::vector<std::string>& problems)
      : node_(node), path_(std::move(path)), file_(std::move(file)), problems_(problems) {}

  void number(const char* key, double& value, Range range, const char* unit, const char*) override {
    const auto node = find(key);
    if (!node) return;
    double read = 0;
    if (!YAML::convert<double>::decode(*node, read) || !std::isfinite(read)) {
      return problem(*node, key, "'" + scalar(*node) + "' is not a number" + wanted_in(unit));
    }
    if (read < range.min || read > range.max) {
      return problem(*node, key, scalar(*node) + " is outside " + range_text(range) + in_unit(unit));
    }
    value = read;
  }

  void integer(const char* key, int64_t& value, Range range, const char* unit, const char*) override {
    const auto node = find(key);
    if (!node) return;
    int64_t read = 0;
    if (!node->IsScalar() || !YAML::convert<int64_t>::decode(*node, read)) {
      return problem(*node, key, "'" + scalar(*node) + "' is not a whole number" + wanted_in(unit));
    }
    if (static_cast<double>(read) < range.min || static_cast<double>(read) > range.max) {
      return problem(*node, key, scalar(*node) + " is outside " + range_text(range) + in_unit(unit));
    }
    value = read;
  }

  void flag(const char* key, bool& value, const char*) override {
    const auto node = find(key);
    if (node && !YAML::convert<bool>::decode(*node, value))
      problem(*node, key, "'" + scalar(*node) + "' is not true or false");
  }

  void text(const char* key, std::string& value, const char*) override {
    const auto node = find(key);
    if (!node) return;
    if (!node->IsScalar() && !node->IsNull()) return problem(*node, key, "must be a text");
    value = node->IsNull() ? "" : node->Scalar();
  }

  void choice(const char* key, std::string& value, std::initializer_list<const char*> allowed, const char*) override {
    const auto node = find(key);
    if (!node) return;
    const std::string read = scalar(*node);
    if (std::find(allowed.begin(), allowed.end(), read) == allowed.end())
      return problem(*node, key, "'" + read + "' is none of: " + core::joined(allowed));
    value = read;
  }

  void list(const char* key, std::vector<std::string>& value, const char*) override {
    const auto node = find(key);
    if (!node) return;
    value.clear();
    if (node->IsNull()) return;
    if (!node->IsSequence()) return problem(*node, key, "must be a list: [a, b]");
    for (const auto& entry : *node) value.push_back(entry.Scalar());
  }

  void group(const char* key, const char*, const std::function<void(Fields&)>& describe) override {
    const auto node = find(key);
    Reader inner(node ? *node : YAML::Node(YAML::NodeType::Map), path_ + "." + key, file_, problems_);
    if (node && !node->IsMap() && !node->IsNull()) return problem(*node, key, "must be a section of keys");
    describe(inner);
    inner.refuse_unknown();
  }

  void refuse_unknown() {
    if (!node_.IsMap()) return;
    for (const auto& entry : node_) {
      const std::string key = entry.first.Scalar();
      if (known_.contains(key)) continue;
      problem(entry.first, key.c_str(),
              "is not a key of this section; " + core::did_you_mean(key, {known_.begin(), known_.end()}));
    }
  }

 private:
  std::optional<YAML::Node> find(const char* key) {
    known_.insert(key);
    if (!node_.IsMap()) return std::nullopt;
    const YAML::Node& constant = node_;
    const YAML::Node node = constant[key];
    if (!node.IsDefined()) return std::nullopt;
    return node;
  }
  static std::string scalar(const YAML::Node& node) { return node.IsScalar() ? node.Scalar() : "(not a single value)"; }
  static std::string in_unit(const char* unit) { return *unit == '\0' ? "" : std::string(" ") + unit; }
  static std::string wanted_in(const char* unit) { return *unit == '\0' ? "" : "; give it in " + std::string(unit); }
  void problem(const YAML::Node& node, const char* key, const std::string& reason) {
    const auto mark = node.Mark();
    const std::string where = mark.is_null() ? "command line" : file_ + " line " + std::to_string(mark.line + 1);
    problems_.push_back(where + ": " + path_ + "." + key + " " + reason);
  }

  YAML::Node node_;
  std::string path_;
  std::string file_;
  std::vector<std::string>& problems_;
  std::set<std::string> known_;
};

class Documenter final : public Fields {
 public:
  explicit Documenter(int indent) : indent_(indent) {}
  void number(const char* key, double& value, Range range, const char* unit, const char* what) override {
    line(key, number_text(value),
         std::string(what) + " [" + (*unit == '\0' ? "" : std::string(unit) + ", ") + range_text(range) + "]");
  }
  void integer(const char* key, int64_t& value, Range range, const char* unit, const char* what) override {
    line(key, std::to_string(value),
         std::string(what) + " [" + (*unit == '\0' ? "" : std::string(unit) + ", ") + range_text(range) + "]");
  }
  void flag(const char* key, bool& value, const char* what) override { line(key, value ? "true" : "false", what); }
  void text(const char* key, std::string& value, const char* what) override {
    line(key, value.empty() ? "\"\"" : value, what);
  }
  void choice(const char* key, std::string& value, std::initializer_list<const char*> allowed,
              const char* what) override {
    line(key, value, std::string(what) + " [" + core::joined(allowed) + "]");
  }
  void list(const char* key, std::vector<std::string>& value, const char* what) override {
    line(key, "[" + core::joined(value) + "]", what);
  }
  void group(const char* key, const char* what, const std::function<void(Fields&)>& describe) override {
    line(key, "", what);
    Documenter inner(indent_ + 2);
    describe(inner);
    out_ << inner.text_so_far();
  }
  [[nodiscard]] std::string text_so_far() const { return out_.str(); }

 private:
  void line(const char* key, const std::string& value, const std::string& comment) {
    const std::string space(static_cast<size_t>(indent_), ' ');
    out_ << space << "# " << comment << '\n' << space << key << ':' << (value.empty() ? "" : " ") << value << '\n';
  }
  int indent_;
  std::ostringstream out_;
};

std::string also(const std::vector<std::string>& sections) {
  std::string names;
  for (const auto& section : sections) names += ", " + section;
  return names;
}

core::Result<YAML::Node> load(const std::filesystem::path& file) {
  if (file.empty()) return YAML::Node(YAML::NodeType::Map);
  if (!std::filesystem::exists(file)) return core::Error{file.string() + " does not exist; --config needs a YAML file"};
  if (std::filesystem::is_directory(file))
    return core::Error{file.string() + " is a folder; --config needs a YAML file"};
  auto node = read_yaml(file, "--config needs a YAML file");
  if (!node.ok()) return node;
  std::error_code unknown;
  if (node.value().IsNull() && std::filesystem::file_size(file, unknown) == 0)
    return core::Error{file.string() +
                       " is empty, as a power cut leaves a file; write it anew (on a train: railfix train upgrade), or "
                       "leave --config out for the defaults"};
  if (node.value().IsNull()) return YAML::Node(YAML::NodeType::Map);
  if (!node.value().IsMap()) return core::Error{file.string() + " must consist of sections, one for each service"};
  return node;
}

core::Status apply_override(YAML::Node section, const std::string& section_name, const Override& change) {
  YAML::Node value;
  try {
    value = value_of_set(change.value);
  } catch (const YAML::Exception&) {
    return core::Error{"command line: " + change.key + "=" + change.value + " is not a YAML value"};
  }
  std::string rest = change.key.substr(section_name.size() + 1);
  try {
    for (size_t dot = rest.find('.'); dot != std::string::npos; dot = rest.find('.')) {
      section.reset(section[rest.substr(0, dot)]);
      rest = rest.substr(dot + 1);
    }
    section[rest] = value;
  } catch (const YAML::Exception&) {
    return core::Error{"command line: " + change.key + ": what stands before the last dot is a value, not a section"};
  }
  return {};
}

}  // namespace

core::Status read_section(const std::string& section, const std::filesystem::path& file,
                          const std::vector<Override>& overrides, const std::vector<std::string>& known_sections,
                          const std::function<void(Fields&)>& describe) {
  auto loaded = load(file);
  if (!loaded.ok()) return loaded.error();
  YAML::Node root = loaded.value();
  std::vector<std::string> problems;
  for (const auto& entry : root) {
    const std::string name = entry.first.Scalar();
    if (name == section || name == "common") continue;
    if (std::find(known_sections.begin(), known_sections.end(), name) == known_sections.end()) {
      problems.push_back(file.string() + " line " + std::to_string(entry.first.Mark().line + 1) + ": section " + name +
                         " belongs to no service; there are common" + also(known_sections));
    }
  }
  YAML::Node node = root[section];
  if (!node.IsDefined() || node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
  if (!node.IsMap()) return core::Error{file.string() + ": section " + section + " must consist of keys and values"};
  for (const auto& change : overrides) {
    if (!change.key.starts_with(section + ".")) continue;
    const auto status = apply_override(node, section, change);
    if (!status.ok()) return status;
  }
  Reader reader(node, section, file.string(), problems);
  describe(reader);
  reader.refuse_unknown();
  if (problems.empty()) return {};
  std::string message;
  for (const auto& problem : problems) message += (message.empty() ? "" : "\n") + problem;
  return core::Error{message};
}

std::string document_section(const std::string& section, const std::function<void(Fields&)>& describe) {
  Documenter documenter(2);
  describe(documenter);
  return section + ":\n" + documenter.text_so_far();
}

}  // namespace railfix::service
