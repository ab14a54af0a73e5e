// One recorded channel on its way back to a topic.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "messaging/topics.hpp"

namespace railfix::tool {

/// A recorded sample, taken apart as far as that may be done before its time.
struct PreparedSample {
  int64_t time_ns = 0;   // log time
  int64_t stamp_ns = 0;  // of the data in it, 0 = it says none
  size_t channel = 0;
  std::vector<uint8_t> cdr;
  cv::Mat pixels;  // of a picture that was recorded as JPEG; then `cdr` holds the rest of it
};

class ReplayedChannel {
 public:
  /// `written_as` is the topic's name now ("camera_frame/cam0"). as_jpeg: pictures that were recorded as CameraPreview.
  ReplayedChannel(messaging::Participant& participant, const messaging::TopicInfo& topic, std::string written_as,
                  bool as_jpeg);

  /// Decodes what takes long. May run in another thread than send(). False: the bytes are not such a sample.
  bool prepare(PreparedSample& sample) const;
  /// False: the bytes are not such a sample, or it could not be sent.
  bool send(const PreparedSample& sample);
  [[nodiscard]] const std::string& written_as() const { return written_as_; }

 private:
  const messaging::Type& type_;
  std::string written_as_;
  bool as_jpeg_;
  std::shared_ptr<void> sample_;
  messaging::AnyWriter writer_;
};

}  // namespace railfix::tool
