#include "messaging/layout.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <string>

#include "core/fnv.hpp"
#include "idl/embedded_idl.hpp"
#include "messaging/topic_layouts.hpp"

namespace railfix::messaging {
namespace {

constexpr std::string_view kLayout = "layout=";

// Of what decides the layout.
uint64_t hash_of(std::string_view idl) {
  core::Fnv hash;
  for (size_t at = 0; at < idl.size(); ++at) {
    if (idl.substr(at, 2) == "//") at = std::min(idl.find('\n', at), idl.size() - 1);
    if (std::isspace(static_cast<unsigned char>(idl[at])) == 0) hash.add(idl[at]);
  }
  return hash.value();
}

}  // namespace

uint64_t layout_of(const TopicInfo& topic) {
  const auto file = std::ranges::find(idl::kEmbeddedIdl, topic.idl, &idl::EmbeddedIdl::name);
  return file == idl::kEmbeddedIdl.end() ? 0 : hash_of(file->text);
}

std::map<std::string, uint64_t> topic_layouts() {
  std::map<std::string, uint64_t> layouts;
  for (const auto& file : idl::kEmbeddedIdl) layouts.emplace(file.name, hash_of(file.text));
  return layouts;
}

std::vector<uint8_t> user_data_of_layout(uint64_t layout) {
  const std::string text = std::string(kLayout) + std::to_string(layout);
  return {text.begin(), text.end()};
}

uint64_t layout_in(const std::vector<uint8_t>& user_data) {
  const std::string text(user_data.begin(), user_data.end());
  uint64_t layout = 0;
  if (text.starts_with(kLayout)) std::from_chars(text.data() + kLayout.size(), text.data() + text.size(), layout);
  return layout;
}

}  // namespace railfix::messaging
