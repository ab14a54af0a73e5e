// Errors that an operator can cause are values: one sentence that says what is wrong, where, and what to do.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

namespace railfix::core {

struct Error {
  std::string message;
};

/// A value or the reason why there is none. value() on an error is a programming mistake and throws
/// std::bad_variant_access.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Result(Error error) : content_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return content_.index() == 0; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] T& value() & { return std::get<0>(content_); }
  [[nodiscard]] const T& value() const& { return std::get<0>(content_); }
  [[nodiscard]] T&& value() && { return std::get<0>(std::move(content_)); }
  [[nodiscard]] const Error& error() const { return std::get<1>(content_); }

 private:
  std::variant<T, Error> content_;
};

/// Result of something that only succeeds or fails.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : message_(std::move(error.message)), ok_(false) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return ok_; }
  explicit operator bool() const { return ok_; }
  [[nodiscard]] Error error() const { return Error{message_}; }

 private:
  std::string message_;
  bool ok_ = true;
};

/// Thrown only out of constructors and out of command-line tools; caught in one place, printed as one sentence, exit
/// code 2.
class BadInput : public std::runtime_error {
 public:
  explicit BadInput(const std::string& sentence) : std::runtime_error(sentence) {}
  explicit BadInput(const Error& error) : std::runtime_error(error.message) {}
};

/// Unwraps a result where an exception is the way out (constructors, command-line tools).
template <class T>
T value_or_throw(Result<T> result) {
  if (!result.ok()) throw BadInput(result.error());
  return std::move(result).value();
}
inline void ok_or_throw(const Status& status) {
  if (!status.ok()) throw BadInput(status.error());
}

}  // namespace railfix::core
