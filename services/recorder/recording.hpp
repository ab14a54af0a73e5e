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
#include "core/sequence_gaps.hpp"
#include "mcap/writer.hpp"
#include "recorder/stored_sample.hpp"

namespace railfix::recorder {

/// Where samples were lost on their way into the file.
enum class Loss {
  transport,  // never came: a gap in the writer's sequence
  queue,      // waited too long for the disk
  encoder,    // pictures came faster than they could be encoded
  disk,       // could not be written
};
const char* name_of(Loss cause);

struct TopicLosses {
  std::string topic;
  std::map<Loss, uint64_t> by_cause;
};

/// Something that people will want to look at.
struct EventNote {
  int64_t time_ns = 0;
  std::string text;
  std::string trigger;  // "by hand", or the rule
};

class Recording {
 public:
  static core::Result<std::unique_ptr<Recording>> create(const std::filesystem::path& file,
                                                         const mcap::WriterOptions& options,
                                                         const std::map<std::string, std::string>& about);

  /// Error: the disk refuses; the sample is counted as lost.
  core::Status write(const StoredSample& sample) { return write(sample, sample.received_ns); }
  /// The same with another log time.
  core::Status write(const StoredSample& sample, int64_t log_time_ns);
  core::Status write_metadata(const mcap::Metadata& metadata) { return writer_->write_metadata(metadata); }
  /// The metadata record `railfix_event`.
  core::Status write_event(const EventNote& note);
  /// `writer` and `sequence` as the middleware gives them, of every sample that reached the recorder's thread. Gaps
  /// that add_dropped() does not explain were lost in transport. `exclusive`: one writer is heard at a time, and the
  /// numbers of the others go on meanwhile.
  void note_sequence(const std::string& topic, uint64_t writer, uint64_t sequence, bool exclusive = false);
  /// What comes next does not follow what came last: no gap.
  void forget_sequences() { sequences_.clear(); }
  /// So many more samples of the topic were dropped in front of the recorder's thread.
  void add_dropped(const std::string& topic, Loss cause, uint64_t count);
  /// Writes what is old enough; losses go into the file at most every ten seconds.
  core::Status tick(int64_t now_monotonic_ns);
  core::Status close();

  /// See mcap::Writer::is_removed().
  [[nodiscard]] bool is_removed() const { return writer_->is_removed(); }

  [[nodiscard]] uint64_t samples() const { return writer_->statistics().messages; }
  [[nodiscard]] uint64_t bytes() const { return writer_->bytes_written(); }
  [[nodiscard]] uint64_t lost_samples() const;
  [[nodiscard]] std::vector<TopicLosses> losses_by_topic() const;
  /// "camera_frame/cam0: 12 encoder, 1 transport; ..."; empty without losses.
  [[nodiscard]] std::string loss_text() const;
  [[nodiscard]] const std::filesystem::path& file() const { return writer_->file(); }

 private:
  explicit Recording(std::unique_ptr<mcap::Writer> writer) : writer_(std::move(writer)) {}
  using Losses = std::map<std::pair<std::string, Loss>, uint64_t>;
  [[nodiscard]] Losses losses() const;
  core::Status write_losses();

  std::unique_ptr<mcap::Writer> writer_;
  std::map<std::shared_ptr<const ChannelOf>, uint16_t> channels_;
  std::map<std::string, core::SequenceGaps> sequences_;
  std::map<std::string, uint64_t> gaps_;
  Losses dropped_;
  uint64_t lost_written_ = 0;
  int64_t losses_written_ns_ = 0;
};

/// A configuration's YAML without the values of tokens and passwords, and without comments: recordings are given away.
/// Of a text that is no YAML only that is said.
std::string without_secrets(const std::string& yaml);

/// Name and CRC-32 of a file for the metadata; empty for an empty name, "not readable" when it is so.
std::string fingerprint(const std::filesystem::path& file);

}  // namespace railfix::recorder
