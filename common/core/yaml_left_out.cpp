#include "core/yaml_left_out.hpp"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <sstream>
#include <vector>

namespace railfix::core {
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

}  // namespace

Status check_nothing_left_out(const std::string& text, const std::string& name) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  LeftOut left_out;
  while (parser.HandleNextDocument(left_out)) {
  }
  std::string message;
  for (const auto& problem : left_out.problems()) message += (message.empty() ? "" : "\n") + name + ": " + problem;
  return message.empty() ? Status() : Status(Error{message});
}

}  // namespace railfix::core
