// One recording: an MCAP file with a channel per topic, what was lost and why, and what the train was.
// Knows no DDS; samples come as CDR bytes. Not thread safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/writer.hpp"

namespace railfix::recorder {

/// How a topic appears in the file.
struct ChannelOf {
  std::string topic;  // "camera_frame/cam0"
  std::string type;   // "railfix::msg::CameraPreview"
  std::string idl;    // self-contained IDL text that defines the type
  std::map<std::string, std::string> metadata;
};

/// Where samples were lost on their way into the file.
enum class Loss {
  transport,  // never came: a gap in the writer's sequence
  queue,      // waited too long for the disk
  encoder,    // pictures came faster than they could be encoded
  disk,       // could not be written
};
const char* name_of(Loss cause);

class Recording {
 public:
  static core::Result<std::unique_ptr<Recording>> create(const std::filesystem::path& file,
                                                         const mcap::WriterOptions& options,
                                                         const std::map<std::string, std::string>& about);

  /// Error: the disk refuses; the sample is counted as lost.
  core::Status write(const ChannelOf& channel, const mcap::Message& sample);
  /// `writer` and `sequence` as the middleware gives them, of every sample that reached the recorder's thread. Gaps
  /// that set_dropped() does not explain were lost in transport.
  void note_sequence(const std::string& topic, uint64_t writer, uint64_t sequence);
  /// How many samples of the topic were dropped in front of the recorder's thread since it began.
  void set_dropped(const std::string& topic, Loss cause, uint64_t total);
  /// Writes what is old enough; losses go into the file at most every ten seconds.
  core::Status tick(int64_t now_monotonic_ns);
  core::Status close();

  [[nodiscard]] uint64_t samples() const { return writer_->statistics().messages; }
  [[nodiscard]] uint64_t bytes() const { return writer_->bytes_written(); }
  [[nodiscard]] uint64_t lost_samples() const;
  /// "camera_frame/cam0: 12 encoder, 1 transport; ..."; empty without losses.
  [[nodiscard]] std::string loss_text() const;
  [[nodiscard]] const std::filesystem::path& file() const { return writer_->file(); }

 private:
  explicit Recording(std::unique_ptr<mcap::Writer> writer) : writer_(std::move(writer)) {}
  using Losses = std::map<std::pair<std::string, Loss>, uint64_t>;
  [[nodiscard]] Losses losses() const;
  core::Status write_losses();

  std::unique_ptr<mcap::Writer> writer_;
  std::map<std::string, uint16_t> channels_;
  std::map<std::pair<std::string, uint64_t>, uint64_t> last_sequence_;
  std::map<std::string, uint64_t> gaps_;
  Losses dropped_;
  uint64_t lost_written_ = 0;
  int64_t losses_written_ns_ = 0;
};

/// Name and CRC-32 of a file for the metadata; empty for an empty name, "not readable" when it is so.
std::string fingerprint(const std::filesystem::path& file);

/// FOLDER/TRAIN-YYYYMMDD-HHMMSS.mcap for this time (UTC), with a number behind it when that exists.
std::filesystem::path new_name(const std::filesystem::path& folder, const std::string& train_id, int64_t now_ns);

/// Makes proper recordings of those in the folder that a crash left behind (NAME.mcap.active that nobody writes), and
/// says a sentence for each.
std::vector<std::string> recover_folder(const std::filesystem::path& folder);

/// Removes the oldest recordings until the folder's recordings take less than this; says which.
std::vector<std::string> keep_quota(const std::filesystem::path& folder, uint64_t most_bytes);

}  // namespace railfix::recorder
