// Rules that say which samples are events: "train_state.integrity != ok", "log_record.level >= error".
#pragma once

#include <functional>
#include <set>
#include <variant>

#include "cdr/types.hpp"
#include "core/result.hpp"
#include "recorder/stored_sample.hpp"

namespace railfix::recorder {

class EventRule {
 public:
  /// "TOPIC.FIELD OP VALUE" or "TOPIC" (every sample is an event). TOPIC with or without its instance; FIELD as in the
  /// IDL, a.b in nested structures, a.3 in arrays; OP one of == != < <= > >= has (a bit of a sum of bits, or a part of
  /// a text); VALUE a number, a text, or a name that the IDL gives the value ("ok" of INTEGRITY_OK, "error" of "4
  /// error"). `type_of` gives the type of a topic, empty when there is none. Error: what is wrong with the rule.
  static core::Result<EventRule> parse(const std::string& text,
                                       const std::function<std::string(const std::string& topic)>& type_of);

  [[nodiscard]] bool concerns(const std::string& topic) const;
  /// True for a sample that fulfils the rule while the one before it (of the same DDS key) did not; of what is said
  /// once, as a line of a log, for each that does. A value that is not known (NaN) fulfils no rule.
  bool begins(const StoredSample& sample);
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  core::Status set_condition(const std::string& type, const std::string& field, const std::string& operation,
                             const std::string& value);

  std::string text_;
  std::string topic_;
  std::vector<std::string> path_;  // empty: every sample
  std::string operation_;
  std::variant<double, std::string> value_;
  std::set<std::string> fulfilled_;  // by topic and DDS key
};

}  // namespace railfix::recorder
