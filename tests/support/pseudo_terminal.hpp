// A serial line whose other end is the test: bytes that it writes come out of a device file, which can be unplugged.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>

namespace railfix::test {

class PseudoTerminal {
 public:
  /// `name`: as which the device is there while this lives.
  explicit PseudoTerminal(std::filesystem::path name)
      : name_(std::move(name)), ours_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)) {
    char device[64] = "";
    EXPECT_TRUE(ours_ >= 0 && grantpt(ours_) == 0 && unlockpt(ours_) == 0 &&
                ptsname_r(ours_, device, sizeof device) == 0)
        << "no pseudo-terminal";
    chmod(device, 0666);  // for programs that give up being root
    std::filesystem::remove(name_);
    std::filesystem::create_symlink(device, name_);
  }
  ~PseudoTerminal() {
    std::filesystem::remove(name_);
    close(ours_);  // who reads is told that the line has hung up
  }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  /// What nobody reads in time is lost, as on a real line.
  void write(std::span<const char> bytes) const { (void)!::write(ours_, bytes.data(), bytes.size()); }
  void read_away() const {
    char bytes[256];
    while (::read(ours_, bytes, sizeof bytes) > 0) {
    }
  }

 private:
  std::filesystem::path name_;
  int ours_;
};

}  // namespace railfix::test
