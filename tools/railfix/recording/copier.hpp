// Writes what stands in recordings into a new one.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/result.hpp"
#include "draft.hpp"
#include "mcap/reader.hpp"
#include "mcap/writer.hpp"

namespace railfix::tool {

/// Gives messages new ids. Nothing is left of its file unless it is closed.
class Copier {
 public:
  /// Error: the file is there already, or its draft, which another one writes or has left.
  static core::Result<std::unique_ptr<Copier>> create(const std::filesystem::path& out);

  /// Also those topics that have no messages.
  core::Status add_topics(const mcap::Reader& from);
  core::Status write(const mcap::Reader& from, const mcap::Channel& channel, mcap::Message message);
  core::Status write(const mcap::Metadata& metadata) { return writer_->write_metadata(metadata); }
  core::Status close();
  [[nodiscard]] size_t topics() const { return topics_.size(); }

 private:
  explicit Copier(const std::filesystem::path& draft) : draft_(draft) {}
  core::Result<uint16_t> id_of(const mcap::Reader& from, const mcap::Channel& channel);

  std::unique_ptr<mcap::Writer> writer_;
  std::map<std::pair<const mcap::Reader*, uint16_t>, uint16_t> ids_;
  std::set<std::string> topics_;
  Draft draft_;  // the last: it goes before the writer could still give it its name
};

/// What a recording is called until it is whole.
std::filesystem::path draft_of(const std::filesystem::path& recording);

/// Of a recording that was copied, a sentence each.
std::vector<std::string> problems_of(const mcap::Reader& reader);

}  // namespace railfix::tool
