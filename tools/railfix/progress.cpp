#include "progress.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <cstdio>

#include "core/time.hpp"

namespace railfix::tool {
namespace {

constexpr int kBarCells = 30;
constexpr int64_t kRedrawNs = 100'000'000;
constexpr double kGuessFromS = 1;  // what is left is not guessed before

}  // namespace

Progress::Progress(std::string title, uint64_t total, bool quiet)
    : title_(std::move(title)),
      total_(total),
      begun_ns_(core::monotonic_ns()),
      terminal_(isatty(STDERR_FILENO) == 1),
      quiet_(quiet) {}

Progress::~Progress() {
  finish();
}

void Progress::update(uint64_t done) {
  done_ = done;
  if (quiet_) return;
  if (terminal_) {
    const int64_t now = core::monotonic_ns();
    if (now - drawn_ns_ < kRedrawNs) return;
    drawn_ns_ = now;
    draw();
  } else if (total_ > 0) {
    const int tenth = static_cast<int>(done * 10 / total_);
    if (tenth == drawn_tenth_) return;
    drawn_tenth_ = tenth;
    draw();
  }
}

void Progress::finish() {
  if (finished_ || quiet_) return;
  finished_ = true;
  if (terminal_ || drawn_tenth_ != 10) draw();
  if (terminal_) std::fputc('\n', stderr);
}

void Progress::draw() {
  const double elapsed_s = core::seconds(core::monotonic_ns() - begun_ns_);
  const auto done = static_cast<unsigned long long>(done_);
  if (total_ == 0) {
    std::fprintf(stderr, "%s%s: %llu, %.0f s%s", terminal_ ? "\r" : "", title_.c_str(), done, elapsed_s,
                 terminal_ ? "" : "\n");
    return;
  }
  const double share = static_cast<double>(done_) / static_cast<double>(total_);
  const bool guessed = share > 0 && elapsed_s > kGuessFromS;
  const std::string left = guessed ? fmt::format(", {:.0f} s left", elapsed_s * (1.0 - share) / share) : "";
  std::string bar(kBarCells, ' ');
  for (int i = 0; i < kBarCells && i < static_cast<int>(share * kBarCells + 0.5); ++i)
    bar[static_cast<size_t>(i)] = '#';
  std::fprintf(stderr, "%s%s [%s] %3.0f %%  %llu of %llu%s%s", terminal_ ? "\r" : "", title_.c_str(), bar.c_str(),
               share * 100, done, static_cast<unsigned long long>(total_), left.c_str(), terminal_ ? "   " : "\n");
}

}  // namespace railfix::tool
