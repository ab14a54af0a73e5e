#include "recording/repair.hpp"

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
  report.lost = mcap::losses_of(reader, report.samples);
  if (status.ok() && report.samples == 0)
    status = core::Error{damaged.string() + " holds no sample that can be read; nothing is written"};
  if (status.ok()) status = copier.write(mcap::repair_trace(report.lost, damaged));
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  report.problems = problems_of(reader);
  return report;
}

}  // namespace railfix::tool
