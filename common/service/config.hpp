// The one configuration reader: YAML into typed structs. Every key has a unit, a default, a range and a sentence;
// unknown, misspelt or out-of-range keys are refused with file, key and reason.
//
//   struct Config {
//     double search_band_m = 0.25;
//     void describe(service::Fields& fields) {
//       fields.number("search_band_m", search_band_m, {0.01, 5.0}, "m", "Half width of the search around the predicted
//       shift.");
//     }
//   };
//   auto config = service::read_config<Config>("fusion", file, overrides);   // Result<Config>
//   service::document_config<Config>("fusion")                               // the same keys as commented YAML
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::service {

struct Range {
  double min;
  double max;
};

/// Visits the keys of one configuration section. Implemented by the reader and by the documentation writer.
class Fields {
 public:
  virtual ~Fields() = default;
  virtual void number(const char* key, double& value, Range range, const char* unit, const char* what) = 0;
  virtual void integer(const char* key, int64_t& value, Range range, const char* unit, const char* what) = 0;
  virtual void flag(const char* key, bool& value, const char* what) = 0;
  virtual void text(const char* key, std::string& value, const char* what) = 0;
  virtual void choice(const char* key, std::string& value, std::initializer_list<const char*> allowed,
                      const char* what) = 0;
  virtual void list(const char* key, std::vector<std::string>& value, const char* what) = 0;
  /// A nested section.
  virtual void group(const char* key, const char* what, const std::function<void(Fields&)>& describe) = 0;
};

/// "section.key=value" from the command line, applied after the file.
struct Override {
  std::string key;
  std::string value;
};

/// Reads section `section` of the YAML file (no file: defaults), then the overrides that begin with "section.".
/// Other sections must be in `known_sections`. Everything wrong is reported in one message, a line each.
core::Status read_section(const std::string& section, const std::filesystem::path& file,
                          const std::vector<Override>& overrides, const std::vector<std::string>& known_sections,
                          const std::function<void(Fields&)>& describe);
/// The section as YAML with a comment (what, unit, range) above every key, at its default.
std::string document_section(const std::string& section, const std::function<void(Fields&)>& describe);

template <class Config>
core::Result<Config> read_config(const std::string& section, const std::filesystem::path& file,
                                 const std::vector<Override>& overrides = {},
                                 const std::vector<std::string>& known_sections = {}) {
  Config config;
  const auto status =
      read_section(section, file, overrides, known_sections, [&](Fields& fields) { config.describe(fields); });
  if (!status.ok()) return status.error();
  return config;
}
template <class Config>
std::string document_config(const std::string& section) {
  Config config;
  return document_section(section, [&](Fields& fields) { config.describe(fields); });
}

}  // namespace railfix::service
