// Cuts a recording at random bytes and at every record boundary, repairs each piece, and counts the messages of whole
// chunks that are missing from the repaired file, with our reader and with the reference reader (npm: @mcap/core).
//
//   railfix-measure-recording-cuts [--cuts 1000] [--file RECORDING] [--compression zstd]
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/random.hpp"
#include "mcap/reader.hpp"
#include "mcap/writer.hpp"
#include "support/mcap_records.hpp"
#include "support/mcap_reference.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;

struct Options {
  int cuts = 1000;
  fs::path file;
  std::string compression = "zstd";
};

/// Twenty seconds like those of a train: an IMU, views, and pictures that do not get smaller.
void record(const fs::path& file, mcap::Compression compression) {
  mcap::WriterOptions options;
  options.chunk_bytes = 16'000;
  options.chunk_age_s = 0;
  options.compression = compression;
  auto writer = core::value_or_throw(mcap::Writer::create(file, options));
  core::Random random(1);
  struct Topic {
    const char* name;
    int per_s;
    size_t bytes;
    uint64_t values;
  };
  for (int ms = 0; ms < 20'000; ++ms) {
    for (const Topic& topic : {Topic{"imu_sample", 100, 100, 4}, Topic{"track_view", 25, 560, 16},
                               Topic{"camera_frame/cam0", 10, 3000, 256}, Topic{"log_record", 1, 80, 26}}) {
      if (ms % (1000 / topic.per_s) != 0) continue;
      std::vector<uint8_t> data(topic.bytes);
      for (auto& byte : data) byte = static_cast<uint8_t>(random.next() % topic.values);
      const uint16_t schema = core::value_or_throw(writer->add_schema(topic.name, "omgidl", "module m {};"));
      const uint16_t channel = core::value_or_throw(writer->add_channel(schema, topic.name, "cdr", {}));
      const int64_t time_ns = int64_t{ms} * 1'000'000;
      core::ok_or_throw(writer->write({channel, 0, time_ns, time_ns, data}));
    }
  }
  core::ok_or_throw(writer->close());
}

std::set<size_t> cut_sizes(const mcap::Bytes& whole, const std::vector<test::RecordEnd>& ends, int random_cuts) {
  std::set<size_t> sizes;
  for (const auto& end : ends) sizes.insert(end.offset);
  core::Random random(2);
  for (int i = 0; i < random_cuts; ++i) {
    size_t size = 0;
    do {
      size = mcap::kMagic.size() + random.next() % (whole.size() - mcap::kMagic.size());
    } while (!sizes.insert(size).second);
  }
  return sizes;
}

int run(const Options& options, const fs::path& folder) {
  const auto compression = options.compression == "lz4"    ? mcap::Compression::lz4
                           : options.compression == "none" ? mcap::Compression::none
                                                           : mcap::Compression::zstd;
  fs::path file = options.file;
  if (file.empty()) record(file = folder / "whole", compression);
  const mcap::Bytes whole = test::bytes_of_file(file);
  const auto ends = test::record_ends(whole);
  if (ends.empty()) throw core::BadInput(file.string() + " is not a recording");
  std::map<std::string, size_t> expected;
  size_t lost = 0;
  for (const size_t size : cut_sizes(whole, ends, options.cuts)) {
    std::ofstream(folder / "cut", std::ios::binary)
        .write(reinterpret_cast<const char*>(whole.data()), static_cast<std::streamsize>(size));
    const std::string name = std::to_string(size) + ".mcap";
    (void)core::value_or_throw(mcap::recover(folder / "cut", folder / name));
    const auto repaired = core::value_or_throw(mcap::Reader::open(folder / name));
    size_t found = 0;
    repaired->for_each({}, [&](const mcap::Channel&, const mcap::Message&) { return ++found > 0; });
    expected[name] = test::messages_before(ends, size);
    lost += expected[name] - std::min(found, expected[name]);
  }
  std::printf(
      "%zu bytes, %zu records, %zu messages (%s); cut at %zu places: every record boundary and %d random bytes\n",
      whole.size(), ends.size(), ends.back().messages, options.compression.c_str(), expected.size(), options.cuts);
  std::printf("messages of whole chunks that the repaired files do not hold: %zu\n", lost);

  const test::McapReference reference(MCAP_REFERENCE_SOURCE, MCAP_REFERENCE_WORK);
  if (!reference.problem().empty()) {
    std::printf("not asked: the reference reader (%s)\n", reference.problem().c_str());
    return lost == 0 ? 0 : 1;
  }
  if (!reference.run("count", folder, folder / "counts.json")) throw core::BadInput("the reference reader failed");
  const auto counts = nlohmann::json::parse(std::ifstream(folder / "counts.json"));
  size_t refused = 0;
  for (const auto& [name, messages] : expected) {
    if (counts.contains(name) && counts[name] == messages) continue;
    if (refused++ < 5)
      std::printf("%s: %zu messages, the reference reader says %s\n", name.c_str(), messages,
                  counts.value(name, nlohmann::json("nothing")).dump().c_str());
  }
  std::printf("repaired files that the reference reader does not accept with the same count: %zu of %zu\n", refused,
              expected.size());
  return lost == 0 && refused == 0 ? 0 : 1;
}

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  railfix::Options options;
  CLI::App app{"What cuts cost a recording"};
  app.add_option("--cuts", options.cuts, "At so many random bytes, besides every record boundary");
  app.add_option("--file", options.file, "A recording; one is made when not given");
  app.add_option("--compression", options.compression, "Of the one that is made: zstd, lz4 or none");
  CLI11_PARSE(app, argc, argv);
  const auto folder = std::filesystem::temp_directory_path() / ("railfix-cuts-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  int result = 2;
  try {
    result = railfix::run(options, folder);
  } catch (const railfix::core::BadInput& error) {
    std::cerr << error.what() << '\n';
  }
  std::filesystem::remove_all(folder);
  return result;
}
