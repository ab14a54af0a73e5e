#include "recording/copier.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;

/// Whoever is killed leaves one.
core::Status no_draft_there(const fs::path& draft) {
  std::error_code failed;
  if (!fs::exists(draft, failed)) return {};
  if (mcap::being_written(draft)) {
    return core::Error{draft.string() + " is being written by another process; wait for its end, or give another name"};
  }
  return core::Error{draft.string() +
                     " was left by a recorder, cut, merge or repair that was killed; remove it, or save what is in it "
                     "with `railfix recording repair " +
                     draft.string() + "` before"};
}

}  // namespace

fs::path draft_of(const fs::path& recording) {
  return recording.string() + ".active";
}

core::Result<std::unique_ptr<Copier>> Copier::create(const fs::path& out) {
  const auto draft = draft_of(out);
  const auto free = no_draft_there(draft);
  if (!free.ok()) return free.error();
  std::unique_ptr<Copier> copier(new Copier(draft));
  mcap::WriterOptions options;
  options.library = "railfix recording";
  options.sync_period_s = 0;
  options.chunk_age_s = 0;
  auto writer = mcap::Writer::create(out, options);
  if (!writer.ok()) {
    if (mcap::being_written(draft)) copier->draft_.keep();  // by another one that came before us
    return writer.error();
  }
  copier->writer_ = std::move(writer).value();
  return copier;
}

core::Status Copier::add_topics(const mcap::Reader& from) {
  for (const auto& [id, channel] : from.channels()) {
    const auto added = id_of(from, channel);
    if (!added.ok()) return added.error();
  }
  return {};
}

core::Status Copier::write(const mcap::Reader& from, const mcap::Channel& channel, mcap::Message message) {
  const auto id = id_of(from, channel);
  if (!id.ok()) return id.error();
  message.channel_id = id.value();
  return writer_->write(message);
}

core::Status Copier::close() {
  auto status = writer_->close();
  if (status.ok()) draft_.keep();
  return status;
}

core::Result<uint16_t> Copier::id_of(const mcap::Reader& from, const mcap::Channel& channel) {
  const auto known = ids_.find({&from, channel.id});
  if (known != ids_.end()) return known->second;
  uint16_t schema_id = 0;
  if (const auto schema = from.schemas().find(channel.schema_id); schema != from.schemas().end()) {
    const auto added = writer_->add_schema(schema->second.name, schema->second.encoding, schema->second.data);
    if (!added.ok()) return added.error();
    schema_id = added.value();
  }
  auto added = writer_->add_channel(schema_id, channel.topic, channel.message_encoding, channel.metadata);
  if (!added.ok()) return added;
  topics_.insert(channel.topic);
  ids_[{&from, channel.id}] = added.value();
  return added;
}

std::vector<std::string> problems_of(const mcap::Reader& reader) {
  auto problems = reader.problems();
  if (const auto count = reader.statistics().attachments; count > 0) {
    problems.push_back(reader.file().string() + ": its " + std::to_string(count) + " attachments are left out");
  }
  return problems;
}

}  // namespace railfix::tool
