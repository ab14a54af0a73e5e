// What a recording costs: samples and pictures into a file, and out of it again.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <filesystem>

#include "core/random.hpp"
#include "mcap/reader.hpp"
#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "pictures/encode.hpp"

namespace railfix {

namespace {

namespace fs = std::filesystem;

fs::path file() {
  return fs::temp_directory_path() / ("railfix-bench-" + std::to_string(::getpid()) + ".mcap");
}

/// A view whose numbers change as measured ones do.
std::vector<uint8_t> view(core::Random& random) {
  msg::TrackView view;
  view.roll_rad(random.normal());
  view.pitch_rad(random.normal());
  view.curvature_per_m(random.normal());
  for (auto& value : view.covariance()) value = random.normal();
  for (auto& value : view.left_u_px()) value = static_cast<float>(random.uniform(0, 1280));
  return messaging::serialize(view);
}

std::unique_ptr<mcap::Writer> create(mcap::Compression compression) {
  mcap::WriterOptions options;
  options.overwrite = true;
  options.compression = compression;
  options.sync_period_s = 0;
  return mcap::Writer::create(file(), options).value();
}

void write_views(benchmark::State& state) {
  core::Random random(1);
  std::vector<std::vector<uint8_t>> samples;
  for (int i = 0; i < 1000; ++i) samples.push_back(view(random));
  auto writer = create(static_cast<mcap::Compression>(state.range(0)));
  const uint16_t channel = writer->add_channel(0, "track_view", "cdr", {}).value();
  int64_t i = 0;
  for (auto _ : state) {
    const auto& sample = samples[static_cast<size_t>(i % 1000)];
    if (!writer->write({channel, 0, i, i, sample}).ok()) state.SkipWithError("disk");
    ++i;
  }
  state.SetItemsProcessed(i);
  state.SetBytesProcessed(i * static_cast<int64_t>(samples[0].size()));
  if (!writer->close().ok()) state.SkipWithError("disk");
  state.counters["file_share"] =
      static_cast<double>(fs::file_size(file())) / (static_cast<double>(i) * static_cast<double>(samples[0].size()));
  fs::remove(file());
}
BENCHMARK(write_views)->ArgName("none_zstd_lz4")->Arg(0)->Arg(1)->Arg(2);

void read_views(benchmark::State& state) {
  core::Random random(1);
  auto writer = create(mcap::Compression::zstd);
  const uint16_t channel = writer->add_channel(0, "track_view", "cdr", {}).value();
  for (int64_t i = 0; i < 50000; ++i) {
    if (!writer->write({channel, 0, i, i, view(random)}).ok()) state.SkipWithError("disk");
  }
  if (!writer->close().ok()) state.SkipWithError("disk");
  int64_t count = 0;
  for (auto _ : state) {
    auto reader = mcap::Reader::open(file()).value();
    reader->for_each({}, [&](const mcap::Channel&, const mcap::Message& message) {
      benchmark::DoNotOptimize(message.data.data());
      return ++count > 0;
    });
  }
  state.SetItemsProcessed(count);
  fs::remove(file());
}
BENCHMARK(read_views)->Unit(benchmark::kMillisecond);

/// A full camera frame with the grain of ballast.
void encode_picture(benchmark::State& state) {
  core::Random random(1);
  std::vector<uint8_t> pixels(1280 * 1024);
  for (size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<uint8_t>(100 + 40 * ((i / 1280 / 8 + i % 1280 / 8) % 2) + random.next() % 24);
  }
  size_t bytes = 0;
  for (auto _ : state) {
    bytes = pictures::encode_jpeg(pixels.data(), 1280, 1024, static_cast<int>(state.range(0))).value().size();
  }
  state.counters["jpeg_kB"] = static_cast<double>(bytes) / 1000;
}
BENCHMARK(encode_picture)->ArgName("quality")->Arg(85)->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace railfix
