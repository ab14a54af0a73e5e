// A progress bar on standard error: redrawn in place on a terminal, a line every 10 % elsewhere.
#pragma once

#include <cstdint>
#include <string>

namespace railfix::tool {

class Progress {
 public:
  /// total 0 = not known: counts only. Nothing is drawn when quiet.
  Progress(std::string title, uint64_t total, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(uint64_t done);
  void finish();

 private:
  void draw();
  std::string title_;
  uint64_t total_;
  uint64_t done_ = 0;
  int64_t begun_ns_;
  int64_t drawn_ns_ = 0;
  int drawn_tenth_ = -1;
  bool terminal_;
  bool quiet_;
  bool finished_ = false;
};

}  // namespace railfix::tool
