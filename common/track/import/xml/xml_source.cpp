#include "track/import/xml/xml_source.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

#include "core/whole_file.hpp"

namespace railfix::track {
namespace {

constexpr std::string_view kWhite = " \t\r\n";

bool is_white(char letter) {
  return kWhite.find(letter) != std::string_view::npos;
}

/// <railml3:track> is <track> where the file's own namespace goes by that prefix, as its first element says.
void strip_own_prefix(pugi::xml_document& document) {
  struct Stripper : pugi::xml_tree_walker {
    std::string prefix;
    bool for_each(pugi::xml_node& at) override {
      const std::string name = at.name();
      if (name.starts_with(prefix)) at.set_name(name.substr(prefix.size()).c_str());
      return true;
    }
  } stripper;
  const std::string root = document.document_element().name();
  stripper.prefix = root.substr(0, root.find(':') + 1);  // npos + 1 = 0
  if (!stripper.prefix.empty()) document.traverse(stripper);
}

}  // namespace

XmlSource::XmlSource(const std::filesystem::path& file) : file_name_(file.string()) {
  text_ = core::value_or_throw(core::read_whole(file));
  const pugi::xml_parse_result parsed = document_.load_buffer(text_.data(), text_.size());
  // Places are counted in UTF-8, which pugixml makes of UTF-16.
  if (text_.starts_with("\xff\xfe") || text_.starts_with("\xfe\xff")) std::erase(text_, '\0');
  for (size_t at = text_.find('\n'); at != std::string::npos; at = text_.find('\n', at + 1)) line_ends_.push_back(at);
  if (!parsed) {
    throw core::BadInput(file_name_ + " line " + line_at(parsed.offset) + ": this is not sound XML (" +
                         parsed.description() + ")");
  }
  strip_own_prefix(document_);
}

std::string XmlSource::line_at(ptrdiff_t offset) const {
  const auto before = std::lower_bound(line_ends_.begin(), line_ends_.end(), offset,
                                       [](size_t end, ptrdiff_t at) { return static_cast<ptrdiff_t>(end) < at; });
  return std::to_string(1 + (before - line_ends_.begin()));
}

core::BadInput XmlSource::wrong(const pugi::xml_node& node, const std::string& what) const {
  return core::BadInput(file_name_ + " line " + line_of(node) + ": " + what);
}

std::optional<double> XmlSource::number(const pugi::xml_node& node, const char* attribute) const {
  const std::string text = node.attribute(attribute).value();
  if (text.find_first_not_of(kWhite) == std::string::npos) return std::nullopt;
  const std::vector<double> numbers = numbers_of(text);
  if (numbers.size() != 1) throw needs_number(node, attribute, ", not \"" + text + "\"");
  return numbers.front();
}

double XmlSource::required(const pugi::xml_node& node, const char* attribute) const {
  const std::optional<double> value = number(node, attribute);
  if (!value) throw needs_number(node, attribute, "");
  return *value;
}

core::BadInput XmlSource::needs_number(const pugi::xml_node& node, const char* attribute,
                                       const std::string& instead) const {
  return wrong(node,
               "<" + std::string(node.name()) + "> needs a number in the attribute \"" + attribute + "\"" + instead);
}

std::string XmlSource::required_text(const pugi::xml_node& node, const char* attribute) const {
  std::string text = node.attribute(attribute).value();
  if (text.empty()) throw wrong(node, "<" + std::string(node.name()) + "> needs the attribute \"" + attribute + "\"");
  return text;
}

std::vector<double> numbers_of(std::string_view text) {
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (true) {
    while (at != end && is_white(*at)) ++at;
    if (at == end) return numbers;
    if (*at == '+' && end - at > 1 && *(at + 1) != '-') ++at;
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value) || (next != end && !is_white(*next))) return {};
    numbers.push_back(value);
    at = next;
  }
}

std::vector<pugi::xml_node> descendants(const pugi::xml_node& node, const char* name) {
  struct Collector : pugi::xml_tree_walker {
    const char* wanted = nullptr;
    std::vector<pugi::xml_node> found;
    bool for_each(pugi::xml_node& at) override {
      if (std::strcmp(at.name(), wanted) == 0) found.push_back(at);
      return true;
    }
  } collector;
  collector.wanted = name;
  pugi::xml_node root = node;
  root.traverse(collector);
  return std::move(collector.found);
}

}  // namespace railfix::track
