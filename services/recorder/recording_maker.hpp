// The files that the recorder begins: their names and numbers, how they are written, and what they say of the train.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "recorder/event_file.hpp"
#include "recorder/recorder_config.hpp"

namespace railfix::recorder {

/// Not thread safe.
class RecordingMaker {
 public:
  /// `about`: what the metadata record `railfix` says, with "train_id" and "version". To be made before anything is
  /// recorded: the highest number in the folder is looked for.
  RecordingMaker(const RecorderConfig& config, std::map<std::string, std::string> about);

  /// With `recorder.file` that file's: it belongs to somebody else.
  [[nodiscard]] std::filesystem::path folder() const;
  /// With `recorder.file` that one first, then others beside it.
  [[nodiscard]] std::filesystem::path next_name() const;
  /// What people mean by a name: a path as it is, a bare name in the folder of the recordings.
  [[nodiscard]] std::filesystem::path named(const std::filesystem::path& name) const;
  /// In the folder of the recordings, for this moment.
  [[nodiscard]] std::filesystem::path timed_name() const;

  /// Error: the file exists, or cannot be written.
  core::Result<std::unique_ptr<Recording>> create(const std::filesystem::path& file);
  /// The same for next_name(). The configured file is replaced by the first recording that gets this name, and only by
  /// that one; what a crash left of it is put aside: see take_warnings().
  core::Result<std::unique_ptr<Recording>> create_next(const std::filesystem::path& file);
  core::Result<std::unique_ptr<EventFile>> create_event_file(const EventNote& note, const Ring::Snapshot& before);
  /// Since the last call.
  std::vector<std::string> take_warnings() { return std::exchange(warnings_, {}); }

 private:
  core::Result<std::unique_ptr<Recording>> create(const std::filesystem::path& file,
                                                  const mcap::WriterOptions& options);
  [[nodiscard]] bool is_configured(const std::filesystem::path& file) const;
  void put_aside_cut_off(const std::filesystem::path& file);
  [[nodiscard]] mcap::WriterOptions writer_options() const;
  /// With the number of the next one.
  const std::map<std::string, std::string>& about_next();

  RecorderConfig config_;
  std::map<std::string, std::string> about_;
  uint64_t number_ = 0;      // of the next recording; 0 = the folder is not ours
  bool file_begun_ = false;  // the one that is configured
  std::vector<std::string> warnings_;
};

}  // namespace railfix::recorder
