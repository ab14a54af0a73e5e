#include "service/yaml_file.hpp"

#include <yaml-cpp/eventhandler.h>

#include <map>
#include <sstream>
#include <vector>

#include "core/whole_file.hpp"

namespace railfix::service {
namespace {

std::string line_text(const YAML::Mark& mark) {
  return std::to_string(mark.line + 1);
}

// Looks at the text and not at its nodes: in those an alias may stand for a tree without end.
class LeftOut final : public YAML::EventHandler {
 public:
  /// Sentences without the file.
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ == 2)
      problems_.push_back("a second document begins in line " + line_text(mark) +
                          ", and only one is read; remove the --- or what is behind it");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { note("", mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { note("", mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t, const std::string& value) override {
    note(value, mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    note("", mark);
    open_.push_back({});
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    note("", mark);
    open_.push_back({.is_map = true, .wants_key = true});
  }
  void OnMapEnd() override { open_.pop_back(); }

 private:
  struct Open {
    bool is_map = false;
    bool wants_key = false;
    std::string key = {};                   // whose value comes next
    std::map<std::string, int> lines = {};  // of the keys so far
  };

  // A node of a map is its key and its value in turn; what is no word is a key of nobody.
  void note(const std::string& word, const YAML::Mark& mark) {
    if (open_.empty() || !open_.back().is_map) return;
    auto& map = open_.back();
    if (map.wants_key) {
      map.key = word;
      const auto [first, is_new] = map.lines.emplace(word, mark.line);
      if (!is_new && !word.empty()) problems_.push_back(path() + " is given twice, " + both(first->second, mark));
    }
    map.wants_key = !map.wants_key;
  }
  static std::string both(int first, const YAML::Mark& second) {
    const auto last = line_text(second);
    return (first == second.line ? "line " + last : "lines " + std::to_string(first + 1) + " and " + last) +
           "; remove one";
  }
  [[nodiscard]] std::string path() const {
    std::string path;
    for (const auto& one : open_) path += (path.empty() || one.key.empty() ? "" : ".") + one.key;
    return path;
  }

  std::vector<Open> open_;
  int documents_ = 0;
  std::vector<std::string> problems_;
};

core::Status check_nothing_left_out(const std::string& text, const std::string& name) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  LeftOut left_out;
  while (parser.HandleNextDocument(left_out)) {
  }
  std::string message;
  for (const auto& problem : left_out.problems()) message += (message.empty() ? "" : "\n") + name + ": " + problem;
  return message.empty() ? core::Status() : core::Status(core::Error{message});
}

// Without places in a text, so that what is wrong with it is not told with a line of the file.
YAML::Node unmarked(const YAML::Node& parsed) {
  if (parsed.IsScalar()) return YAML::Node(parsed.Scalar());
  YAML::Node plain(parsed.Type());
  for (const auto& entry : parsed) {
    if (parsed.IsMap()) {
      plain[entry.first.Scalar()] = unmarked(entry.second);
    } else {
      plain.push_back(unmarked(entry));
    }
  }
  return plain;
}

std::string text_of(const std::filesystem::path& file) {
  auto text = core::read_whole(file);
  if (!text.ok()) throw YAML::BadFile(file.string());
  return std::move(text).value();
}

}  // namespace

YAML::Node load_yaml(const std::filesystem::path& file) {
  return YAML::Load(text_of(file));
}

core::Result<YAML::Node> read_yaml(const std::filesystem::path& file, const std::string& remedy) {
  try {
    const auto text = text_of(file);
    auto node = YAML::Load(text);
    if (const auto whole = check_nothing_left_out(text, file.string()); !whole.ok()) return whole.error();
    return node;
  } catch (const YAML::BadFile&) {
    return core::Error{file.string() + " cannot be opened; " + remedy};
  } catch (const YAML::Exception& error) {
    return core::Error{file.string() + " line " + line_text(error.mark) + ": not valid YAML: " + error.msg};
  }
}

YAML::Node value_of_set(const std::string& text) {
  if (text.empty()) return {};
  const bool is_yaml = std::string("[{\"'").find(text.front()) != std::string::npos;
  return is_yaml ? unmarked(YAML::Load(text)) : YAML::Node(text);
}

}  // namespace railfix::service
