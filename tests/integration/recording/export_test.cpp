// `railfix recording info` and `export` as a user calls them, on a made-up ride with pictures.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <opencv2/videoio.hpp>
#include <set>

#include "integration/recording/recorded_ride.hpp"
#include "support/other_writers_file.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

using Export = RecordedRide;

TEST_F(Export, InfoTellsWhatIsThereAndWhetherItIsWhole) {
  const auto info = recording({"info", file().string(), "--json"});
  ASSERT_EQ(info.exit_code, 0) << info.out << info.err;
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["from"], "2023-11-14T22:13:20.000Z");
  EXPECT_NEAR(json["duration_s"].get<double>(), (kPictures - 1) * 0.04, 1e-6);
  EXPECT_EQ(json["lost"]["imu_sample queue"], "12");
  EXPECT_TRUE(json["check"]["sound"]);
  const auto& topics = json["topics"];
  const auto pictures =
      std::ranges::find_if(topics, [](const nlohmann::json& topic) { return topic["topic"] == "camera_frame/cam0"; });
  ASSERT_NE(pictures, topics.end());
  EXPECT_EQ((*pictures)["samples"], kPictures - 1);
  EXPECT_NEAR((*pictures)["longest_gap_s"].get<double>(), 0.08, 1e-6);
  EXPECT_FALSE((*pictures)["ends_early"]);

  std::fstream(file(), std::ios::binary | std::ios::in | std::ios::out).seekp(3000).write("XXXX", 4);
  const auto damaged = recording({"info", file().string()});
  EXPECT_EQ(damaged.exit_code, 1);
  EXPECT_THAT(damaged.out, HasSubstr("check: PROBLEMS"));
}

TEST_F(Export, InfoTellsOfASensorThatDiedAndOneThatCameLate) {
  writer_ = mcap::Writer::create(folder_ / "dead.mcap", {}).value();
  msg::ImuSample imu;
  for (int64_t i = 0; i < 2000; ++i) write(topics::imu_sample, imu, "imu_sample", i * 10'000'000);
  msg::WheelSample wheel;
  for (int64_t i = 0; i <= 3000; ++i)
    write(topics::wheel_sample, wheel, "wheel_sample", 30'000'000'000 + i * 10'000'000);
  ASSERT_TRUE(writer_->close().ok());
  const auto info = recording({"info", (folder_ / "dead.mcap").string()});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_THAT(info.out, ::testing::ContainsRegex("imu_sample +2000 +100.00 +[0-9.]+ +40.01 +20.0 +railfix"));
  EXPECT_THAT(info.out, ::testing::ContainsRegex("wheel_sample +3001 +100.00 +[0-9.]+ +30.00 +30.0 +railfix"));
}

TEST_F(Export, ARecordingWithoutSamplesHasNoBeginning) {
  const auto empty = folder_ / "empty.mcap";
  ASSERT_TRUE(core::value_or_throw(mcap::Writer::create(empty, {}))->close().ok());
  const auto info = recording({"info", empty.string()});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_THAT(info.out, HasSubstr("no samples"));
  EXPECT_THAT(info.out, ::testing::Not(HasSubstr("1970")));
  EXPECT_TRUE(nlohmann::json::parse(recording({"info", empty.string(), "--json"}).out)["from"].is_null());
}

TEST_F(Export, TablesHaveAColumnForEachMember) {
  const auto exported = recording({"export", file().string(), "--csv", (folder_ / "csv").string()});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  const std::string states = test::slurp(folder_ / "csv" / "train_state.csv");
  EXPECT_THAT(states, ::testing::StartsWith("log_time_ns,publish_time_ns,sequence,stamp_ns,"));
  EXPECT_EQ(std::ranges::count(states, '\n'), kPictures + 1);
  EXPECT_THAT(test::slurp(folder_ / "csv" / "log_record.csv"), HasSubstr(R"("wheel, ""left"", slides")"));
  std::string array = ",0.0";
  for (int i = 1; i < 16; ++i) array += ";0.0";
  EXPECT_NE(test::slurp(folder_ / "csv" / "track_view.csv").find(array + ","), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ / "csv" / "camera_frame_cam0.csv"));
}

TEST_F(Export, TablesHaveNamesWhereTheIdlHasThem) {
  ASSERT_EQ(recording({"export", file().string(), "--csv", (folder_ / "csv").string()}).exit_code, 0);
  std::ifstream table(folder_ / "csv" / "train_state.csv");
  std::string header;
  std::string row;
  std::getline(table, header);
  std::getline(table, row);
  const auto cell = [&](const std::string& column) {
    const auto at = header.find("," + column + ",");
    const auto before = std::count(header.begin(), header.begin() + static_cast<std::ptrdiff_t>(at) + 1, ',');
    std::stringstream cells(row);
    std::string one;
    for (auto i = before; i >= 0; --i) std::getline(cells, one, ',');
    return one;
  };
  EXPECT_EQ(cell("integrity"), "OK");
  EXPECT_EQ(cell("sources"), "CAMERA|WHEEL");
  EXPECT_EQ(cell("edge"), "3");
}

TEST_F(Export, NothingIsLeftOfTablesThatFindNoRoom) {
  const auto folder = folder_ / "csv";
  const auto exported = recording_in(1, "export " + file().string() + " --topics train_state --csv " + folder.string());
  EXPECT_EQ(exported.exit_code, 2) << exported.out;
  EXPECT_THAT(exported.err, HasSubstr("there are no tables in " + folder.string() + ": cannot write " +
                                      (folder / "train_state.csv.draft").string() +
                                      " to its end (File too large); give another place"));
  EXPECT_FALSE(fs::exists(folder));
}

TEST_F(Export, NothingIsLeftOfTablesThatAreInterrupted) {
  const auto csv = folder_ / "csv";
  fs::create_directories(csv);
  std::ofstream(csv / "notes.txt") << "mine";
  writer_ = mcap::Writer::create(folder_ / "long.mcap", {}).value();
  for (int i = 0; i < 300; ++i) ride(i);
  msg::ImuSample imu;
  for (int64_t i = 0; i < 300'000; ++i) write(topics::imu_sample, imu, "imu_sample", i * 1'000'000);
  ASSERT_TRUE(writer_->close().ok());
  const auto left = [&] { return std::distance(fs::directory_iterator(csv), fs::directory_iterator()); };
  for (const int signal : {SIGINT, SIGTERM}) {
    test::Program tables({"railfix", "recording", "export", (folder_ / "long.mcap").string(), "--csv", csv.string()},
                         {folder_ / "log", {}, {}});
    while (left() < 3 && !tables.exit_code()) poll(nullptr, 0, 1);
    EXPECT_EQ(tables.end(signal), 128 + signal) << test::slurp(folder_ / "log");
    EXPECT_EQ(left(), 1) << "notes.txt only";
  }
  EXPECT_EQ(test::slurp(csv / "notes.txt"), "mine");
}

TEST_F(Export, TablesOfTwoRecordingsAreNotMixed) {
  const auto folder = folder_ / "csv";
  fs::create_directories(folder);
  std::ofstream(folder / "notes.txt") << "mine";
  ASSERT_EQ(recording({"export", file().string(), "--topics", "train_state", "--csv", folder.string()}).exit_code, 0)
      << "files of other kinds may be there";
  const auto other = folder_ / "other.mcap";
  fs::copy_file(file(), other);
  const auto refused = recording({"export", other.string(), "--topics", "track_view", "--csv", folder.string()});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_EQ(refused.err, "railfix: --csv " + folder.string() +
                             " holds train_state.csv already, which would be mixed with the tables of " +
                             other.string() + "; give an empty folder, or remove the tables there\n");
  EXPECT_FALSE(fs::exists(folder / "track_view.csv"));
}

TEST_F(Export, MapsGetTheTrackWithItsConfidence) {
  const auto gpx = folder_ / "ride.gpx";
  const auto geojson = folder_ / "ride.geojson";
  const auto exported = recording({"export", file().string(), "--gpx", gpx.string(), "--geojson", geojson.string()});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(test::slurp(gpx), HasSubstr("lat=\"47.00003597\" lon=\"8.00000000\"><time>2023-11-14T22:13:20.200Z"))
      << "the first place that was known";
  const auto json = nlohmann::json::parse(test::slurp(geojson));
  ASSERT_EQ(json["features"].size(), 3U) << "the track, and two seconds with their intervals";
  EXPECT_EQ(json["features"][0]["geometry"]["type"], "MultiLineString");
  EXPECT_EQ(json["features"][0]["geometry"]["coordinates"][0].size(), kPictures - 5U);
  const auto& interval = json["features"][1];
  EXPECT_EQ(interval["properties"]["over_m"], 6);
  const auto& ends = interval["geometry"]["coordinates"];
  EXPECT_NEAR((ends[1][1].get<double>() - ends[0][1].get<double>()) * 111195, 10, 0.01);

  const auto kept = folder_ / "kept.gpx";
  fs::create_hard_link(gpx, kept);
  std::ofstream(gpx) << "old";
  ASSERT_EQ(recording({"export", file().string(), "--gpx", gpx.string()}).exit_code, 0);
  EXPECT_EQ(test::slurp(kept), "old") << "the new file took its place as a whole";

  const auto nowhere = recording({"export", file().string(), "--gpx", gpx.string(), "--to", "0.1"});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("does not say in this part where on the Earth the train was"));
}

TEST_F(Export, MapsTellPlacesThatMustNotBeUsed) {
  writer_ = mcap::Writer::create(folder_ / "lost.mcap", {}).value();
  for (int i = 5; i < 35; ++i) {
    integrity_ = i < 15 ? msg::INTEGRITY_OK : i < 25 ? msg::INTEGRITY_UNUSABLE : msg::INTEGRITY_DEGRADED;
    ride(i);
  }
  ASSERT_TRUE(writer_->close().ok());
  const auto gpx = folder_ / "ride.gpx";
  const auto geojson = folder_ / "ride.geojson";
  ASSERT_EQ(recording({"export", folder_ / "lost.mcap", "--gpx", gpx, "--geojson", geojson}).exit_code, 0);
  const auto text = test::slurp(gpx);
  const auto unusable = text.find("<name>train, unusable</name>");
  ASSERT_NE(unusable, std::string::npos);
  const auto places = [](const std::string& part) {
    size_t count = 0;
    for (auto at = part.find("<trkpt"); at != std::string::npos; at = part.find("<trkpt", at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(places(text.substr(0, unusable)), 20U);
  EXPECT_EQ(places(text.substr(unusable)), 10U);
  const auto usable = text.substr(0, unusable);
  EXPECT_NE(usable.find("<trkseg>"), usable.rfind("<trkseg>")) << "no line over the unusable part";

  const auto features = nlohmann::json::parse(test::slurp(geojson))["features"];
  std::vector<std::pair<std::string, size_t>> lines;
  for (const auto& feature : features) {
    if (feature["properties"]["name"] != "train") continue;
    lines.emplace_back(feature["properties"]["integrity"], feature["geometry"]["coordinates"][0].size());
  }
  const std::vector<std::pair<std::string, size_t>> expected{{"ok", 10}, {"degraded", 10}, {"unusable", 12}};
  EXPECT_EQ(lines, expected) << "the unusable line reaches from the last usable place to the next";
  EXPECT_EQ(features.back()["properties"]["integrity"], "degraded");
}

TEST_F(Export, APartIsNamedThatTheRecordingHas) {
  const auto refusal = [&](const std::vector<std::string>& part) {
    std::vector<std::string> arguments{"export", file().string(), "--gpx", (folder_ / "part.gpx").string()};
    arguments.insert(arguments.end(), part.begin(), part.end());
    const auto refused = recording(arguments);
    EXPECT_EQ(refused.exit_code, 2) << refused.out;
    return refused.err;
  };
  EXPECT_THAT(refusal({"--from", "500"}), HasSubstr("there is nothing from 500 s to the end: "));
  EXPECT_THAT(refusal({"--from", "50", "--to", "10"}), HasSubstr("--to 10 must lie behind --from 50"));
}

TEST_F(Export, StandardOutputHasTheTrackAlone) {
  const auto to_stdout = recording({"export", file().string(), "--gpx", "/dev/stdout"});
  EXPECT_EQ(to_stdout.exit_code, 0) << to_stdout.err;
  EXPECT_THAT(to_stdout.out, ::testing::StartsWith("<?xml"));
  EXPECT_THAT(to_stdout.out, ::testing::EndsWith("</gpx>\n"));
  EXPECT_THAT(to_stdout.err, HasSubstr("/dev/stdout: 45 places of the train"));
  const auto log = folder_ / "log";
  std::ofstream(log) << "precious\n";
  const std::string command = std::string(RAILFIX_BIN_DIR) + "/railfix recording export " + file().string();
  const auto appended = test::run_program({"/bin/sh", "-c", command + " --gpx /dev/stdout >> " + log.string()}, 120);
  EXPECT_EQ(appended.exit_code, 0) << appended.err;
  EXPECT_EQ(test::slurp(log), "precious\n" + to_stdout.out);
  const auto piped = test::run_program({"/bin/sh", "-c", command + " --gpx /dev/stdout | cat"}, 120);
  EXPECT_EQ(piped.out, to_stdout.out);
}

TEST_F(Export, TwoFilesHaveTwoNames) {
  const auto one = (folder_ / "one").string();
  const auto refused = recording({"export", file().string(), "--gpx", one, "--geojson", (folder_ / "./one").string()});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--gpx and --geojson are both "));
  EXPECT_FALSE(fs::exists(one));
}

TEST_F(Export, NothingIsWrittenOverARecordingOrTheTablesOfARun) {
  const auto size = fs::file_size(file());
  for (const std::string kind : {"--gpx", "--geojson", "--mp4"}) {
    const auto refused = recording({"export", file().string(), kind, file().string()});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr(kind + " " + file().string() + " is " + file().string() + " itself"));
  }
  EXPECT_EQ(recording({"cut", file().string(), "--out", file().string()}).exit_code, 2);
  EXPECT_EQ(fs::file_size(file()), size);
  fs::create_directories(folder_ / "run");
  std::ofstream(folder_ / "run" / "run.yaml") << "common:\n";
  const auto refused = recording({"export", file().string(), "--csv", (folder_ / "run").string()});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is the folder of a run"));
}

TEST_F(Export, AFilmRunsAsFastAsTheTrain) {
  const auto mp4 = folder_ / "ride.mp4";
  const auto exported = recording({"export", file().string(), "--mp4", mp4.string()});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(exported.out, HasSubstr("50 frames at 25 Hz of 49 pictures, both rails drawn in 49"));
  cv::VideoCapture film(mp4.string());
  EXPECT_EQ(film.get(cv::CAP_PROP_FPS), 25);
  cv::Mat frame;
  int frames = 0;
  cv::Mat middle;
  while (film.read(frame)) {
    if (frames++ == 30) middle = frame.clone();
  }
  EXPECT_EQ(frames, kPictures) << "the missing picture's predecessor stands twice";
  ASSERT_EQ(middle.size(), cv::Size(320, 240));
  // Away from what is drawn the picture is as grey as it was.
  EXPECT_NEAR(middle.at<cv::Vec3b>(100, 10)[1], 4 * 30, 8);
  const auto none = recording({"export", file().string(), "--mp4", mp4.string(), "--camera", "cam7"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("has no pictures of camera cam7"));
}

TEST_F(Export, AFilmThatIsCutIsToldAndTakesNoPlace) {
  const auto mp4 = folder_ / "ride.mp4";
  std::ofstream(mp4) << "old";
  const auto cut = recording_in(4, "export " + file().string() + " --mp4 " + mp4.string());
  EXPECT_EQ(cut.exit_code, 2) << cut.out;
  EXPECT_THAT(cut.err, ::testing::EndsWith("railfix: cannot write " + mp4.string() +
                                           " to its end (File too large); give another place\n"));
  EXPECT_EQ(cut.out, "");
  const std::string command = std::string(RAILFIX_BIN_DIR) + "/railfix recording export " + file().string();
  const auto full = test::run_program({"/bin/bash", "-c",
                                       "(trap '' XFSZ; ulimit -f 0; exec " + command + " --mp4 " + mp4.string() +
                                           " 2>&1) | cat; exit ${PIPESTATUS[0]}"},
                                      120);
  EXPECT_EQ(full.exit_code, 2);
  EXPECT_THAT(full.out, HasSubstr("railfix: cannot write " + mp4.string() + " to its end (File too large)"));
  EXPECT_EQ(test::slurp(mp4), "old");
  EXPECT_EQ(files(), (std::set<std::string>{"ride.mcap", "ride.mp4"}));
}

TEST_F(Export, AFilmThatIsInterruptedLeavesTheOlderOneAlone) {
  const auto mp4 = folder_ / "ride.mp4";
  std::ofstream(mp4) << "old";
  // A picture that stands for ten minutes: there is time to interrupt.
  writer_ = mcap::Writer::create(folder_ / "long.mcap", {}).value();
  for (const int i : {0, 15'000}) ride(i);
  ASSERT_TRUE(writer_->close().ok());
  for (const int signal : {SIGINT, SIGTERM}) {
    test::Program film(
        {"railfix", "recording", "export", (folder_ / "long.mcap").string(), "--mp4", mp4.string(), "--fps", "120"},
        {folder_ / "log", {}, {}});
    while (files().size() == 4 && !film.exit_code()) poll(nullptr, 0, 1);
    EXPECT_EQ(film.end(signal), 128 + signal) << test::slurp(folder_ / "log");
    EXPECT_EQ(test::slurp(mp4), "old");
    EXPECT_EQ(files(), (std::set<std::string>{"log", "long.mcap", "ride.mcap", "ride.mp4"}));
  }
}

TEST_F(Export, AHostileDescriptionOfATypeIsRefusedWithASentence) {
  std::string nested = "struct T { ";
  for (int i = 0; i < 200'000; ++i) nested += "sequence<";
  const auto hostile = folder_ / "hostile.mcap";
  writer_ = mcap::Writer::create(hostile, {}).value();
  const auto schema = writer_->add_schema("T", "omgidl", nested).value();
  const auto channel = writer_->add_channel(schema, "nested", "cdr", {}).value();
  ASSERT_TRUE(writer_->write({channel, 1, kBegin, kBegin, std::vector<uint8_t>{0, 1, 0, 0}}).ok());
  ASSERT_TRUE(writer_->close().ok());
  const auto exported = recording({"export", hostile.string(), "--csv", (folder_ / "tables").string()});
  EXPECT_EQ(exported.exit_code, 0);
  EXPECT_THAT(exported.err, HasSubstr("nested: 1 samples were left out; the recording's description of their type T "
                                      "cannot be read: IDL line 1: more than 32 sequences stand in each other"));
}

TEST_F(Export, ATypeThatChangedHasATableForEachVersion) {
  const auto changed = folder_ / "changed.mcap";
  writer_ = mcap::Writer::create(changed, {}).value();
  uint8_t number = 0;
  for (const char* type : {"struct T { octet speed; octet way; };", "struct T { octet way; octet speed; };"}) {
    const auto schema = writer_->add_schema("T", "omgidl", type).value();
    const auto channel = writer_->add_channel(schema, "foo", "cdr", {}).value();
    ++number;
    ASSERT_TRUE(writer_->write({channel, number, kBegin, kBegin, std::vector<uint8_t>{0, 1, 0, 0, number, 9}}).ok());
  }
  ASSERT_TRUE(writer_->close().ok());
  const auto tables = folder_ / "tables";
  const auto exported = recording({"export", changed.string(), "--csv", tables.string()});
  EXPECT_THAT(exported.err, HasSubstr("foo: its type changed; each version has a table of its own, the last is " +
                                      (tables / "foo-2.csv").string()));
  EXPECT_THAT(test::slurp(tables / "foo.csv"), HasSubstr(",speed,way\n"));
  EXPECT_THAT(test::slurp(tables / "foo-2.csv"), HasSubstr(",way,speed\n"));
  EXPECT_THAT(test::slurp(tables / "foo-2.csv"), HasSubstr(",2,2,9\n"));
}

TEST_F(Export, NothingOfOtherWritersFilesIsLeftOut) {
  for (unsigned bits = 0; bits < test::OtherSummary::kCombinations; bits += 3) {
    const auto other = folder_ / "other.mcap";
    const auto bytes = test::other_writers_file(test::OtherSummary(bits));
    std::ofstream(other, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    const auto info = recording({"info", other.string(), "--json"});
    ASSERT_EQ(info.exit_code, 0) << bits << info.out << info.err;
    const auto json = nlohmann::json::parse(info.out);
    EXPECT_EQ(json["samples"], test::kOtherSamples) << bits;
    EXPECT_EQ(json["duration_s"], test::kOtherSamples - 1.0) << bits;
    EXPECT_TRUE(json["closed"]) << bits;
    const auto tables = folder_ / std::to_string(bits);
    ASSERT_EQ(recording({"export", other.string(), "--csv", tables.string()}).exit_code, 0);
    EXPECT_EQ(std::ranges::count(test::slurp(tables / "other.csv"), '\n'), test::kOtherSamples + 1) << bits;
  }
}

}  // namespace
}  // namespace railfix
