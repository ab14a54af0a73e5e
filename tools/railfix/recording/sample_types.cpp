#include "recording/sample_types.hpp"

#include <algorithm>

#include "cdr/decode.hpp"
#include "messaging/topics.hpp"

namespace railfix::tool {

namespace {
constexpr size_t kEncapsulationBytes = 4;
constexpr size_t kInt64Bytes = 8;
}  // namespace

std::string SampleTypes::type_name(const mcap::Channel& channel) const {
  const auto schema = reader_.schemas().find(channel.schema_id);
  return schema == reader_.schemas().end() ? "" : schema->second.name;
}

const SampleTypes::Described& SampleTypes::described(const mcap::Schema& schema) {
  const auto [known, added] = by_schema_.try_emplace(schema.id);
  if (added && schema.encoding == "omgidl") known->second.read = known->second.types.add(schema.data);
  return known->second;
}

const cdr::Types* SampleTypes::types(const mcap::Channel& channel) {
  const auto schema = reader_.schemas().find(channel.schema_id);
  if (schema == reader_.schemas().end()) return nullptr;
  const auto& name = schema->second.name;
  // A text that cannot be read has no such type: then our own are asked.
  const auto& own = described(schema->second).types;
  if (own.find(name) != nullptr) return &own;
  return cdr::own_types().find(name) != nullptr ? &cdr::own_types() : nullptr;
}

std::string SampleTypes::why_unknown(const mcap::Channel& channel) {
  const auto schema = reader_.schemas().find(channel.schema_id);
  if (schema == reader_.schemas().end()) return "the recording does not describe their type";
  const auto& read = described(schema->second).read;
  return "the recording's description of their type " + schema->second.name +
         (read.ok() ? " is not there or not in IDL" : " cannot be read: " + read.error().message);
}

const cdr::Structure* SampleTypes::structure(const mcap::Channel& channel) {
  const auto* known = types(channel);
  return known == nullptr ? nullptr : known->find(type_name(channel));
}

bool SampleTypes::keyed(const mcap::Channel& channel) {
  const auto* type = structure(channel);
  return type != nullptr && std::ranges::any_of(type->members, &cdr::Member::key);
}

std::string SampleTypes::key(const mcap::Channel& channel, mcap::ByteView cdr) {
  if (!keyed(channel)) return "";
  const auto* type = structure(channel);
  const auto sample = cdr::decode(*types(channel), type->name, cdr);
  if (!sample.ok()) return "";
  std::string key;
  for (const auto& member : type->members) {
    if (member.key) key += sample.value()[member.name].dump() + "\n";
  }
  return key;
}

bool latched(const mcap::Channel& channel) {
  if (const auto said = channel.metadata.find("transient_local"); said != channel.metadata.end()) {
    return said->second == "true";
  }
  const auto* topic = messaging::find_topic(channel.topic);
  return topic != nullptr && topic->qos.transient_local;
}

std::optional<int64_t> leading_int64(const cdr::Structure& structure, const std::string& member, mcap::ByteView cdr) {
  size_t offset = kEncapsulationBytes;
  for (const auto& one : structure.members) {
    const bool whole = one.type.kind == cdr::Kind::int64 || one.type.kind == cdr::Kind::uint64;
    if (!whole || !one.type.dimensions.empty() || cdr.size() < offset + kInt64Bytes) return std::nullopt;
    if (one.name != member) {
      offset += kInt64Bytes;
      continue;
    }
    const bool little_endian = (cdr[1] & 1U) != 0;
    uint64_t value = 0;
    for (size_t i = 0; i < kInt64Bytes; ++i) {
      value |= uint64_t{cdr[offset + i]} << (8 * (little_endian ? i : kInt64Bytes - 1 - i));
    }
    return static_cast<int64_t>(value);
  }
  return std::nullopt;
}

}  // namespace railfix::tool
