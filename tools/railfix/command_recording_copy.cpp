// `railfix recording cut` and `merge`.
#include <iostream>
#include <limits>
#include <memory>

#include "command_recording.hpp"
#include "not_negative.hpp"
#include "output_file.hpp"
#include "recording/copy.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;

struct CopyOptions {
  std::vector<fs::path> files;
  fs::path out;
  CutOptions cut{0, std::numeric_limits<double>::infinity(), {}, {}};
};

void print(const CopyReport& report, const fs::path& out) {
  for (const auto& problem : report.problems) std::cerr << problem << '\n';
  std::cout << out.string() << ": " << report.samples << " samples of " << report.topics << " topics";
}

void print_lost(const CopyReport& report) {
  if (report.lost.bytes > 0) std::cout << "; missing: " << mcap::told(report.lost);
  std::cout << '\n';
}

int cut(const CopyOptions& options) {
  check_output("--out", options.out, options.files);
  const auto report = core::value_or_throw(cut_recording(options.files.front(), options.out, options.cut));
  print(report, options.out);
  if (report.standing > 0) std::cout << ", and " << report.standing << " values that held at the beginning";
  print_lost(report);
  return 0;
}

int merge(const CopyOptions& options) {
  check_output("--out", options.out, options.files);
  const auto report = core::value_or_throw(merge_recordings(options.files, options.out));
  print(report, options.out);
  if (report.duplicates > 0) std::cout << "; " << report.duplicates << " stood in more than one, kept once";
  print_lost(report);
  return 0;
}

}  // namespace

void add_recording_cut(CLI::App& recording, Action& chosen) {
  auto options = std::make_shared<CopyOptions>();
  auto* command =
      recording.add_subcommand("cut",
                               "A part of a recording as a recording of its own, with the calibrations and other "
                               "standing values that held at its "
                               "beginning, e.g. railfix recording cut run.mcap --from 60 --to 90 --out event.mcap");
  command->add_option("file", options->files, "The recording")->required()->expected(1);
  command->add_option("--from", options->cut.from_s, "Seconds into the recording")->check(not_negative());
  command->add_option("--to", options->cut.to_s, "Seconds into the recording")->check(not_negative());
  command->add_option("--topics", options->cut.topics, "Only these, separated by commas")->delimiter(',');
  command->add_option("--without", options->cut.without, "Not these, separated by commas")->delimiter(',');
  command->add_option("--out", options->out, "The new recording")->required();
  command->callback([options, &chosen] { chosen = [options] { return cut(*options); }; });
}

void add_recording_merge(CLI::App& recording, Action& chosen) {
  auto options = std::make_shared<CopyOptions>();
  auto* command = recording.add_subcommand(
      "merge",
      "Several recordings of one train as one, in the order of time; what stands in more than one is kept once, e.g. "
      "railfix recording merge demo-*.mcap --out day.mcap");
  command->add_option("files", options->files, "The recordings")->required()->expected(2, 10000);
  command->add_option("--out", options->out, "The new recording")->required();
  command->callback([options, &chosen] { chosen = [options] { return merge(*options); }; });
}

}  // namespace railfix::tool
