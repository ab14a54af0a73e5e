// PGM (netpbm.sourceforge.net/doc/pgm.html), binary: "P5 WIDTH HEIGHT GREATEST", one white space, pixels of one or two
// bytes.
#include <algorithm>
#include <cctype>
#include <string>

#include "pictures/formats.hpp"

namespace railfix::pictures {
namespace {

/// The numbers of the head, behind white space and comments.
class Head {
 public:
  explicit Head(std::span<const uint8_t> file) : file_(file) {}

  /// 0 where there is none.
  int64_t number() {
    skip_white_space();
    constexpr int64_t kGreatest = 1'000'000'000;
    int64_t value = 0;
    for (; at_ < file_.size() && std::isdigit(file_[at_]) != 0; ++at_) {
      value = std::min<int64_t>(value * 10 + (file_[at_] - '0'), kGreatest);
    }
    return value;
  }
  /// What is behind the one white space that ends the head.
  [[nodiscard]] std::span<const uint8_t> rest() const { return file_.subspan(std::min(at_ + 1, file_.size())); }

 private:
  void skip_white_space() {
    for (; at_ < file_.size() && (std::isspace(file_[at_]) != 0 || file_[at_] == '#'); ++at_) {
      if (file_[at_] != '#') continue;
      while (at_ + 1 < file_.size() && file_[at_] != '\n') ++at_;
    }
  }

  std::span<const uint8_t> file_;
  size_t at_ = 2;
};

}  // namespace

core::Status decode_pgm(std::span<const uint8_t> file, Pixels pixels, const Memory& memory) {
  constexpr int64_t kOneByte = 255;
  constexpr int64_t kTwoBytes = 65535;
  Head head(file);
  const int64_t width = head.number();
  const int64_t height = head.number();
  const int64_t greatest = head.number();
  if (auto size = check_size(width, height); !size.ok()) return size;
  if (greatest < 1 || greatest > kTwoBytes) return broken("its greatest grey is " + std::to_string(greatest));
  const auto count = static_cast<size_t>(width * height);
  const size_t bytes = greatest > kOneByte ? 2 : 1;
  const auto data = head.rest();
  if (data.size() < bytes * count) return broken("it ends too early");
  const size_t channels = pixels == Pixels::grey ? 1 : 3;
  uint8_t* const to = memory(static_cast<int>(width), static_cast<int>(height));
  if (greatest == kOneByte && channels == 1) {
    std::copy_n(data.begin(), count, to);
    return {};
  }
  for (size_t i = 0; i < count; ++i) {
    const int64_t grey = bytes == 1 ? data[i] : data[2 * i] * 256 + data[2 * i + 1];
    std::fill_n(to + channels * i, channels, static_cast<uint8_t>(std::min(grey, greatest) * kOneByte / greatest));
  }
  return {};
}

}  // namespace railfix::pictures
