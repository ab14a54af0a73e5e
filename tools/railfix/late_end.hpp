// For work that leaves more than one file: Ctrl-C, SIGTERM and SIGHUP are noted, and end the program once it has tidied
// up.
#pragma once

namespace railfix::tool {

class LateEnd {
 public:
  /// REQUIRES: no other one and no Draft lives.
  LateEnd();
  /// Ends the program as the signal does without us, if one has come. What is to be tidied up goes before.
  ~LateEnd();
  LateEnd(const LateEnd&) = delete;
  LateEnd& operator=(const LateEnd&) = delete;

  /// To be asked often. A second signal ends the program at once.
  [[nodiscard]] static bool asked();
};

}  // namespace railfix::tool
