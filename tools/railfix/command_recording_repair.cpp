#include <filesystem>
#include <iostream>
#include <memory>

#include "command_recording.hpp"
#include "core/result.hpp"
#include "mcap/check.hpp"
#include "mcap/reader.hpp"
#include "output_file.hpp"
#include "recording/copier.hpp"
#include "recording/repair.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;
using core::BadInput;

struct RepairOptions {
  fs::path file;
  fs::path out;
};

/// Closed properly, every chunk can be read, and `recording info` finds nothing.
bool sound(const fs::path& file, const mcap::Reader& reader) {
  return reader.indexed() && reader.problems().empty() && core::value_or_throw(mcap::check(file)).problems.empty();
}

int repair(const RepairOptions& options) {
  const auto reader = core::value_or_throw(mcap::Reader::open(options.file));
  if (mcap::being_written(options.file)) {
    throw BadInput(options.file.string() + " is being written by a recorder now; stop that first");
  }
  if (sound(options.file, *reader)) {
    std::cout << options.file.string() << " is a whole recording; nothing to repair\n";
    return 0;
  }
  const fs::path out = options.out.empty() ? mcap::recovered_name(options.file) : options.out;
  check_output("--out", out, {options.file});
  if (fs::exists(out)) throw BadInput(out.string() + " exists already; give another name with --out, or remove it");
  std::error_code failed;
  if (fs::equivalent(draft_of(out), options.file, failed)) {
    throw BadInput("the draft of " + out.string() + " would be " + options.file.string() +
                   ", which is read; give another name with --out");
  }
  const auto report = core::value_or_throw(repair_recording(options.file, out));
  for (const auto& problem : report.problems) std::cerr << problem << '\n';
  std::cout << out.string() << ": " << report.samples << " samples of " << report.topics
            << " topics; missing: " << mcap::told(report.lost) << '\n';
  return 0;
}

}  // namespace

void add_recording_repair(CLI::App& recording, Action& chosen) {
  auto options = std::make_shared<RepairOptions>();
  auto* command = recording.add_subcommand(
      "repair",
      "Make a proper file of one that a crash, a power cut or a bad disk damaged: everything in whole chunks is kept, "
      "e.g. railfix recording repair demo-20261121-101500.mcap.active");
  command->add_option("file", options->file, "The damaged recording; it is left as it is")->required();
  command->add_option("--out", options->out, "The repaired one; NAME-recovered.mcap beside it when not given");
  command->callback([options, &chosen] { chosen = [options] { return repair(*options); }; });
}

}  // namespace railfix::tool
