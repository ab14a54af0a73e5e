// Things in a sentence.
#pragma once

#include <functional>
#include <string>

namespace railfix::core {

/// "a, b, c": what `name_of` gives of each, by itself the thing.
template <class Things, class NameOf = std::identity>
std::string joined(const Things& things, const NameOf& name_of = {}) {
  std::string text;
  for (const auto& thing : things) text += (text.empty() ? "" : ", ") + std::string(std::invoke(name_of, thing));
  return text;
}

}  // namespace railfix::core
