#include "recorder/recording_maker.hpp"

#include <utility>

#include "core/time.hpp"
#include "core/whole_file.hpp"
#include "mcap/reader.hpp"
#include "recorder/recordings_folder.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

mcap::Compression compression_of(const std::string& name) {
  if (name == "none") return mcap::Compression::none;
  return name == "lz4" ? mcap::Compression::lz4 : mcap::Compression::zstd;
}

}  // namespace

RecordingMaker::RecordingMaker(const RecorderConfig& config, std::map<std::string, std::string> about)
    : config_(config), about_(std::move(about)) {
  if (config_.file.empty()) number_ = next_number(folder());
}

fs::path RecordingMaker::folder() const {
  if (config_.file.empty()) return config_.folder;
  const fs::path file(config_.file);
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

// A second start must not take away what the first one recorded.
fs::path RecordingMaker::next_name() const {
  if (config_.file.empty()) return timed_name();
  const fs::path first(config_.file);
  if (!file_begun_) return first;
  fs::path next;
  for (int i = 2; next.empty() || is_taken(next); ++i) {
    next = first.parent_path() / (first.stem().string() + "-" + std::to_string(i) + first.extension().string());
  }
  return next;
}

// The working directory of a service is nothing that people know, and no quota or survey looks there.
fs::path RecordingMaker::named(const fs::path& name) const {
  if (name.has_parent_path()) return name;
  fs::path file = folder() / name;
  if (file.extension() != ".mcap") file += ".mcap";
  return file;
}

fs::path RecordingMaker::timed_name() const {
  return new_name(config_.folder, about_.at("train_id"), core::wall_ns());
}

mcap::WriterOptions RecordingMaker::writer_options() const {
  mcap::WriterOptions options;
  options.chunk_bytes = static_cast<uint64_t>(config_.chunk_mb * kBytesPerMb);
  options.chunk_age_s = config_.chunk_age_s;
  options.sync_period_s = config_.sync_period_s;
  options.compression = compression_of(config_.compression);
  options.library = "railfix recorder " + about_.at("version");
  return options;
}

const std::map<std::string, std::string>& RecordingMaker::about_next() {
  if (number_ > 0) about_[kNumberKey] = std::to_string(number_++);
  return about_;
}

// The folder belongs to somebody else, so nothing in it is recovered; but what was recorded is not ours to destroy.
void RecordingMaker::put_aside_cut_off(const fs::path& file) {
  const fs::path cut_off = file.string() + kActive;
  std::error_code failed;
  if (!fs::is_regular_file(cut_off, failed) || mcap::being_written(cut_off)) return;
  fs::path aside;
  for (int i = 1; aside.empty() || is_taken(aside); ++i) {
    const std::string number = i == 1 ? "" : "-" + std::to_string(i);
    aside = file.parent_path() / (file.stem().string() + "-cut-off" + number + file.extension().string());
  }
  aside += kActive;
  fs::rename(cut_off, aside, failed);
  warnings_.push_back(failed ? cut_off.string() + " was left by a crash, cannot be put aside (" + failed.message() +
                                   ") and is replaced"
                             : cut_off.string() + " was left by a crash and is now " + aside.string() +
                                   "; `railfix recording repair` makes a proper file of it");
}

core::Result<std::unique_ptr<Recording>> RecordingMaker::create_next(const fs::path& file) {
  mcap::WriterOptions options = writer_options();
  options.overwrite = !file_begun_ && is_configured(file);
  if (options.overwrite) put_aside_cut_off(file);
  return create(file, options);
}

// Whoever says a name does not know what is there.
core::Result<std::unique_ptr<Recording>> RecordingMaker::create(const fs::path& file) {
  return create(file, writer_options());
}

bool RecordingMaker::is_configured(const fs::path& file) const {
  std::error_code failed;
  return !config_.file.empty() &&
         fs::weakly_canonical(fs::absolute(file), failed) == fs::weakly_canonical(fs::absolute(config_.file), failed);
}

core::Result<std::unique_ptr<Recording>> RecordingMaker::create(const fs::path& file,
                                                                const mcap::WriterOptions& options) {
  about_["started_ns"] = std::to_string(core::wall_ns());
  auto recording = Recording::create(file, options, about_next());
  if (!recording.ok()) return recording;
  if (const auto text = core::read_whole(config_.train_file); text.ok()) {
    const auto status = recording.value()->write_metadata(
        {"railfix_configuration", {{"file", config_.train_file}, {"text", without_secrets(text.value())}}});
    if (!status.ok()) return status.error();
  }
  // Only now: what the disk refuses has not been begun, and is the next one again.
  if (is_configured(file)) file_begun_ = true;
  return recording;
}

core::Result<std::unique_ptr<EventFile>> RecordingMaker::create_event_file(const EventNote& note,
                                                                           const Ring::Snapshot& before) {
  const fs::path file = new_name(folder(), about_.at("train_id"), core::wall_ns(), kEventKind);
  return EventFile::create(file, writer_options(), about_next(), note, before,
                           static_cast<uint64_t>(config_.ring_mb * kBytesPerMb));
}

}  // namespace railfix::recorder
