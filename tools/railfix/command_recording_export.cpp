// `railfix recording export`.
#include <iostream>
#include <limits>
#include <memory>

#include "command_recording.hpp"
#include "late_end.hpp"
#include "not_negative.hpp"
#include "number_between.hpp"
#include "output_file.hpp"
#include "recording/export_csv.hpp"
#include "recording/export_track.hpp"
#include "recording/export_video.hpp"
#include "recording/part_in_time.hpp"
#include "recording/topic_names.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  fs::path file;
  fs::path csv;
  fs::path gpx;
  fs::path geojson;
  fs::path mp4;
  std::vector<std::string> topics;
  VideoOptions video;
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
};

mcap::Selection part_of(const mcap::Reader& reader, const ExportOptions& options) {
  auto part = core::value_or_throw(part_in_time(reader, options.from_s, options.to_s));
  core::ok_or_throw(check_topics(reader, options.topics));
  for (const auto& [id, channel] : reader.channels()) {
    if (names_topic(options.topics, channel.topic)) part.topics.insert(channel.topic);
  }
  return part;
}

void write_tables(mcap::Reader& reader, const mcap::Selection& part, const fs::path& folder) {
  const LateEnd end;
  const auto report = core::value_or_throw(export_csv(reader, part, folder, [&] { return !end.asked(); }));
  for (const auto& problem : report.problems) std::cerr << problem << '\n';
  std::cout << folder.string() << ": " << report.tables << " tables, " << report.rows << " rows\n";
}

void write_tracks(mcap::Reader& reader, const mcap::Selection& part, const ExportOptions& options) {
  const auto track = core::value_or_throw(read_track(reader, part));
  const auto points = [](const std::vector<std::vector<TrackPoint>>& lines) {
    size_t count = 0;
    for (const auto& line : lines) count += line.size();
    return std::to_string(count);
  };
  if (!options.gpx.empty()) core::ok_or_throw(write_gpx(track, options.gpx));
  if (!options.geojson.empty()) core::ok_or_throw(write_geojson(track, options.geojson));
  say_beside({options.gpx, options.geojson});
  for (const auto& file : {options.gpx, options.geojson}) {
    if (!file.empty())
      std::cout << file.string() << ": " << points(track.train) << " places of the train, " << points(track.gnss)
                << " GNSS fixes\n";
  }
}

void write_film(mcap::Reader& reader, const mcap::Selection& part, const ExportOptions& options) {
  const auto report = core::value_or_throw(export_video(reader, part, options.video, options.mp4));
  for (const auto& problem : report.problems) std::cerr << problem << '\n';
  std::cout << options.mp4.string() << ": " << report.codec << ", " << report.frames << " frames at " << report.fps
            << " Hz of " << report.pictures << " pictures, both rails drawn in " << report.with_rails << '\n';
}

/// Tables of a run have the names that ours have, and other columns; of what is left of another recording or another
/// part nobody could tell that it belongs to that.
void check_tables(const fs::path& folder, const fs::path& recording) {
  std::error_code none;  // it is made then
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    if (entry.path().extension() != ".csv") continue;
    throw core::BadInput("--csv " + folder.string() + " holds " + entry.path().filename().string() +
                         " already, which would be mixed with the tables of " + recording.string() +
                         "; give an empty folder, or remove the tables there");
  }
}

void check_outputs(const ExportOptions& options) {
  check_output("--gpx", options.gpx, {options.file});
  check_output("--geojson", options.geojson, {options.file});
  check_output("--mp4", options.mp4, {options.file});
  check_different({{"--gpx", options.gpx}, {"--geojson", options.geojson}, {"--mp4", options.mp4}});
  if (!options.csv.empty() && fs::exists(options.csv / "run.yaml")) {
    throw core::BadInput("--csv " + options.csv.string() +
                         " is the folder of a run, whose tables have the same names; give another folder");
  }
  if (!options.csv.empty()) check_tables(options.csv, options.file);
}

int run(const ExportOptions& options) {
  if (options.csv.empty() && options.gpx.empty() && options.geojson.empty() && options.mp4.empty()) {
    throw core::BadInput("say what to make of it: --csv FOLDER, --gpx FILE, --geojson FILE or --mp4 FILE");
  }
  check_outputs(options);
  const auto reader = core::value_or_throw(mcap::Reader::open(options.file));
  const auto part = part_of(*reader, options);
  const bool tracks = !options.gpx.empty() || !options.geojson.empty();
  const bool alone = is_standard_output(options.gpx) || is_standard_output(options.geojson);
  if (tracks && alone) write_tracks(*reader, part, options);  // before anything is said there
  if (!options.csv.empty()) write_tables(*reader, part, options.csv);
  if (tracks && !alone) write_tracks(*reader, part, options);
  if (!options.mp4.empty()) write_film(*reader, part, options);
  for (const auto& problem : reader->problems()) std::cerr << problem << '\n';
  return 0;
}

}  // namespace

void add_recording_export(CLI::App& recording, Action& chosen) {
  auto options = std::make_shared<ExportOptions>();
  auto* command = recording.add_subcommand(
      "export",
      "A recording as tables, as a track for maps, or as a film with the rails drawn, e.g. railfix recording export "
      "run.mcap --gpx run.gpx --mp4 run.mp4");
  command->add_option("file", options->file, "The recording")->required();
  command->add_option("--csv", options->csv, "Folder for a table of each topic, without tables yet");
  command->add_option("--gpx", options->gpx, "File for the track as GPX; /dev/stdout = standard output");
  command->add_option("--geojson", options->geojson,
                      "File for the track with its confidence intervals as GeoJSON, as --gpx");
  command->add_option("--mp4", options->mp4, "File for the film");
  command->add_option("--topics", options->topics, "Only tables of these, separated by commas")->delimiter(',');
  command->add_option("--camera", options->video.camera, "Camera of the film; the first one that has pictures");
  command->add_option("--fps", options->video.fps, "Frames a second of the film; as the pictures come")
      ->check(number_between(1.0, 120.0));
  command->add_option("--from", options->from_s, "Seconds into the recording")->check(not_negative());
  command->add_option("--to", options->to_s, "Seconds into the recording, behind --from")->check(not_negative());
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace railfix::tool
