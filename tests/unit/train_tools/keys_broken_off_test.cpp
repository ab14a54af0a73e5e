// Keys whose making is ended by a kill or a power cut: whenever that is, the train has keys that work, and the same
// command does the rest.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include "messaging/security.hpp"
#include "support/program.hpp"
#include "train/keys.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::IsEmpty;

constexpr const char* kSmallTrain = R"(train:
  id: re460-042
  domain: 12
  release: 1.2.0
  run_as: programs
  security: true
  hosts: { cab: { address: 10.42.1.11 } }
  services: { tpr_publisher: cab }
)";

bool is_rename(uint64_t call) {
#ifdef SYS_rename
  if (call == SYS_rename) return true;
#endif
  return call == SYS_renameat || call == SYS_renameat2;
}

/// False when the process was killed where it wanted to rename for this time, counted from 1.
template <class Work>
bool ends_before_rename(int count, Work work) {
  const pid_t pid = fork();
  if (pid == 0) {
    ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    raise(SIGSTOP);
    _exit(work() ? 0 : 1);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  ptrace(PTRACE_SETOPTIONS, pid, nullptr, PTRACE_O_TRACESYSGOOD | PTRACE_O_EXITKILL);
  for (int signal = 0;;) {
    ptrace(PTRACE_SYSCALL, pid, nullptr, signal);
    waitpid(pid, &status, 0);
    if (!WIFSTOPPED(status)) return WIFEXITED(status) && WEXITSTATUS(status) == 0;
    const bool is_call = WSTOPSIG(status) == (SIGTRAP | 0x80);
    signal = is_call ? 0 : WSTOPSIG(status);
    __ptrace_syscall_info call{};
    if (!is_call || ptrace(PTRACE_GET_SYSCALL_INFO, pid, sizeof(call), &call) <= 0) continue;
    if (call.op != PTRACE_SYSCALL_INFO_ENTRY || !is_rename(call.entry.nr) || --count > 0) continue;
    kill(pid, SIGKILL);
    waitpid(pid, &status, 0);
    return false;
  }
}

class KeysBrokenOff : public TrainFolder {
 protected:
  [[nodiscard]] std::vector<std::string> errors() const {
    std::vector<std::string> texts;
    for (const auto& finding : check_certificates(train_, *train_.host("cab"))) {
      if (finding.error) texts.push_back(finding.text);
    }
    return texts;
  }
  [[nodiscard]] int trusted_by_cab() const {
    const auto text = test::slurp(security_ / "cab/ca.pem");
    int count = 0;
    for (size_t at = 0; (at = text.find("BEGIN CERTIFICATE", at)) != std::string::npos; ++at) ++count;
    return count;
  }
  void restore(const fs::path& from) {
    fs::remove_all(security_);
    if (fs::exists(from)) fs::copy(from, security_, fs::copy_options::recursive);
  }
  /// From what is there; then all of it is done.
  void break_off_everywhere(const KeysOptions& options, int trusted) {
    const auto before = folder_ / "before";
    fs::remove_all(before);
    const bool first = !fs::exists(security_);
    if (!first) fs::copy(security_, before, fs::copy_options::recursive);
    const auto make = [&] { return make_keys(train_, options).ok(); };
    int count = 1;
    for (; !ends_before_rename(count, make); ++count) {
      ASSERT_LT(count, 100) << "it does not end by itself";
      const auto when = "before rename " + std::to_string(count);
      if (!first) {
        EXPECT_THAT(errors(), IsEmpty()) << when;
      }
      const auto again = make_keys(train_, options);
      ASSERT_TRUE(again.ok()) << when << ": " << again.error().message;
      const auto told = told_of_keys(train_, options, again.value());
      const bool had_begun = count > 1;  // the first one says what is begun
      EXPECT_EQ(told.front().find("had been broken off; it is done now") != std::string::npos, had_begun) << when;
      expect_whole(trusted, when);
      restore(before);
    }
    EXPECT_GT(count, 3) << "it was never broken off";
    expect_whole(trusted, "undisturbed");
  }
  void expect_whole(int trusted, const std::string& when) const {
    EXPECT_THAT(errors(), IsEmpty()) << when;
    EXPECT_TRUE(messaging::key_fits(security_ / "authority/ca.key.pem", security_ / "authority/ca.pem").ok()) << when;
    EXPECT_TRUE(messaging::signed_by(security_ / "authority/ca.pem", security_ / "cab/tool.cert.pem").ok()) << when;
    EXPECT_EQ(trusted_by_cab(), trusted) << when;
    for (const auto& entry : fs::directory_iterator(security_))
      EXPECT_FALSE(entry.path().filename().string().starts_with('.')) << entry << " is left, " << when;
  }
  const Manifest train_ = manifest(kSmallTrain).value();
  const fs::path security_ = folder_ / "security";
};

TEST_F(KeysBrokenOff, TheFirstOnes) {
  break_off_everywhere({}, 1);
}

TEST_F(KeysBrokenOff, NewOnes) {
  ASSERT_TRUE(make_keys(train_, {}).ok());
  break_off_everywhere({.renew = true}, 1);
}

TEST_F(KeysBrokenOff, EveryStepOfTheAuthoritysExchange) {
  ASSERT_TRUE(make_keys(train_, {}).ok());
  break_off_everywhere({.next_authority = true}, 2);
  break_off_everywhere({.renew = true}, 2);
  break_off_everywhere({.drop_authority = true}, 1);
}

// A host that the renewal has not come to has certificates by the former authority.
TEST_F(KeysBrokenOff, NothingElseIsDoneBeforeTheRest) {
  ASSERT_TRUE(make_keys(train_, {}).ok());
  ASSERT_TRUE(make_keys(train_, {.next_authority = true}).ok());
  ASSERT_FALSE(ends_before_rename(6, [&] { return make_keys(train_, {.renew = true}).ok(); }));
  for (const KeysOptions& other : {KeysOptions{}, KeysOptions{.drop_authority = true}}) {
    const auto refused = make_keys(train_, other);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().message, "railfix train keys " + folder_.string() +
                                           " --renew was broken off and is done in part; type it again first");
  }
  ASSERT_TRUE(make_keys(train_, {.renew = true}).ok());
  EXPECT_TRUE(make_keys(train_, {.drop_authority = true}).ok());
}

// As a release before this one could leave it.
TEST_F(KeysBrokenOff, ACertificateThatDoesNotFitItsKeyIsMadeAnew) {
  ASSERT_TRUE(make_keys(train_, {}).ok());
  fs::copy_file(security_ / "cab/tool.key.pem", security_ / "cab/onboard.key.pem",
                fs::copy_options::overwrite_existing);
  const auto made = make_keys(train_, {});
  ASSERT_TRUE(made.ok());
  EXPECT_EQ(made.value().certificates, 1U);
  EXPECT_TRUE(messaging::key_fits(security_ / "cab/onboard.key.pem", security_ / "cab/onboard.cert.pem").ok());
}

}  // namespace
}  // namespace railfix::tool
