// An XML file with a human way to say what is wrong in it.
#pragma once

#include <filesystem>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::track {

class XmlSource {
 public:
  /// Throws core::BadInput with file and line where the file cannot be read or is not sound XML.
  explicit XmlSource(const std::filesystem::path& file);

  /// First element. It and all others go without the prefix that the first one has in the file.
  [[nodiscard]] pugi::xml_node root() const { return document_.document_element(); }
  [[nodiscard]] const std::string& file_name() const { return file_name_; }
  /// Where it stands in the file, from 1.
  [[nodiscard]] std::string line_of(const pugi::xml_node& node) const { return line_at(node.offset_debug()); }
  [[nodiscard]] core::BadInput wrong(const pugi::xml_node& node, const std::string& what) const;
  /// A finite number in an attribute, nothing without the attribute or with an empty one; `required` throws then, and
  /// both throw where there is anything else.
  [[nodiscard]] std::optional<double> number(const pugi::xml_node& node, const char* attribute) const;
  [[nodiscard]] double required(const pugi::xml_node& node, const char* attribute) const;
  /// Text of an attribute that must be there.
  [[nodiscard]] std::string required_text(const pugi::xml_node& node, const char* attribute) const;

 private:
  [[nodiscard]] core::BadInput needs_number(const pugi::xml_node& node, const char* attribute,
                                            const std::string& instead) const;
  [[nodiscard]] std::string line_at(ptrdiff_t offset) const;
  std::string file_name_;
  std::string text_;
  std::vector<size_t> line_ends_;  // of the text
  pugi::xml_document document_;
};

/// Finite numbers separated by white space; empty when there is anything else.
std::vector<double> numbers_of(std::string_view text);

/// Every descendant of that name, in document order.
std::vector<pugi::xml_node> descendants(const pugi::xml_node& node, const char* name);

}  // namespace railfix::track
