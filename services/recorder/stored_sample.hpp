// A sample as it goes into files: its CDR bytes and the channel that they belong to.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace railfix::recorder {

/// How a topic appears in the file.
struct ChannelOf {
  std::string topic;  // "camera_frame/cam0"
  std::string type;   // "railfix::msg::CameraPreview"
  std::string idl;    // self-contained IDL text that defines the type
  std::map<std::string, std::string> metadata;
};

struct StoredSample {
  std::shared_ptr<const ChannelOf> channel;
  uint32_t sequence = 0;
  int64_t received_ns = 0;
  int64_t sent_ns = 0;
  std::vector<uint8_t> cdr;
  /// Tells the standing values of a topic apart (its name and the sample's DDS key): every file must hold the last one
  /// of each. Empty: not a standing value.
  std::string standing;
};
using SamplePtr = std::shared_ptr<const StoredSample>;

}  // namespace railfix::recorder
