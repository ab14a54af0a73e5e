// The table of what is broken: one entry a fault.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "system/rig.hpp"

namespace railfix::system_test {

struct Fault {
  std::string name;
  std::function<void(Rig&)> begin;
  std::function<void(Rig&)> end;        // takes it away after lasts_s; what heals itself: at the end of the watch
  std::function<bool(Rig&)> over = {};  // asked meanwhile: it is over before lasts_s
  double lasts_s = 0;                   // 0 = an instant, after which the train must help itself
  double watch_s = 8;                   // behind it
  std::string named;                    // somebody's complaint contains this
  bool in_short = false;                // part of the short campaign
};

/// For the train as the rig has it. REQUIRES: the rig lives longer.
std::vector<Fault> fault_table(const Rig& rig);

/// What the fault "rogue participant" starts as a process of its own: writes lies as train_state 50 times a second with
/// the greatest strength until it is killed. `keys` empty: without certificate.
int be_rogue(const std::string& train_id, int64_t domain, const std::string& service, const std::string& keys);

}  // namespace railfix::system_test
