#include "recording/repair.hpp"

#include <algorithm>

#include "recording/copier.hpp"

namespace railfix::tool {

namespace {

core::Status copy(mcap::Reader& reader, Copier& copier, RepairReport& report) {
  auto status = copier.add_topics(reader);
  for (const auto& metadata : reader.metadata()) {
    if (status.ok()) status = copier.write(metadata);
  }
  if (!status.ok()) return status;
  reader.for_each({}, [&](const mcap::Channel& channel, const mcap::Message& message) {
    status = copier.write(reader, channel, message);
    report.samples += status.ok() ? 1 : 0;
    return status.ok();
  });
  return status;
}

void note_losses(const mcap::Reader& reader, RepairReport& report) {
  report.lost_chunks = reader.lost_chunks().size();
  report.skipped_bytes = reader.unread_bytes();
  for (const auto& [place, bytes] : reader.lost_chunks()) report.skipped_bytes += bytes;
  const uint64_t counted = reader.statistics().messages;
  if (reader.indexed()) report.lost_samples = counted - std::min(counted, report.samples);
}

mcap::Metadata trace_of(const RepairReport& report, const std::filesystem::path& damaged) {
  mcap::Metadata trace{"railfix_repair",
                       {{"file", damaged.filename().string()},
                        {"lost_chunks", std::to_string(report.lost_chunks)},
                        {"skipped_bytes", std::to_string(report.skipped_bytes)}}};
  if (report.lost_samples) trace.entries["lost_samples"] = std::to_string(*report.lost_samples);
  return trace;
}

}  // namespace

core::Result<RepairReport> repair_recording(const std::filesystem::path& damaged, const std::filesystem::path& out) {
  auto opened = mcap::Reader::open(damaged);
  if (!opened.ok()) return opened.error();
  mcap::Reader& reader = *opened.value();
  auto created = Copier::create(out);
  if (!created.ok()) return created.error();
  Copier& copier = *created.value();
  RepairReport report;
  auto status = copy(reader, copier, report);
  note_losses(reader, report);
  if (status.ok()) status = copier.write(trace_of(report, damaged));
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  report.problems = problems_of(reader);
  return report;
}

}  // namespace railfix::tool
