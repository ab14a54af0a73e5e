// Configuration of the recorder: section `recorder`.
#pragma once

#include "service/config.hpp"

namespace railfix::recorder {

struct RecorderConfig {
  std::string folder = "recordings";
  std::string file;
  bool autostart = true;
  std::vector<std::string> leave_out;
  std::vector<std::string> cameras = {"cam0"};
  std::string pictures = "jpeg";
  int64_t picture_quality = 85;
  int64_t picture_every = 1;
  int64_t picture_queue = 120;
  int64_t sample_queue = 20000;
  std::string compression = "zstd";
  double chunk_mb = 1.0;
  double chunk_age_s = 1.0;
  double sync_period_s = 5.0;
  double keep_free_mb = 500;
  double quota_mb = 0;
  double split_mb = 4000;
  double split_min = 60;
  std::vector<std::string> events;
  double ring_s = 0;
  double after_s = 10;
  double ring_mb = 1000;
  std::string ring_pictures = "full";
  double events_mb = 20000;
  std::string map;
  std::string train_file;

  void describe(service::Fields& fields) {
    describe_what(fields);
    describe_files(fields);
    describe_events(fields);
    fields.text("map", map, "Map file in use; its name and checksum go into the recording.");
    fields.text("train_file", train_file,
                "Configuration of the train; its name, checksum and text go into the recording.");
  }

 private:
  void describe_what(service::Fields& fields) {
    fields.text("folder", folder, "Folder of the recordings; each is called TRAIN-YYYYMMDD-HHMMSS.mcap (UTC).");
    fields.text("file", file,
                "Record into this one file instead, replacing it; empty = a new file in the folder for every start.");
    fields.flag("autostart", autostart, "Record from the beginning; otherwise wait for the command start.");
    fields.list("leave_out", leave_out, "Topics that are not recorded.");
    fields.list("cameras", cameras,
                "Cameras that are listened to before they show up; others are found within a second.");
    fields.choice("pictures", pictures, {"jpeg", "full", "none"},
                  "Pictures as JPEG, every pixel as it is (1.3 MB each at 1280x1024), or not at all.");
    fields.integer("picture_quality", picture_quality, {1, 100}, "", "JPEG quality.");
    fields.integer("picture_every", picture_every, {1, 100000}, "", "Record every n-th picture of a camera.");
    fields.integer("picture_queue", picture_queue, {1, 1000}, "pictures",
                   "Pictures that may wait for the encoder or, full ones, for the disk; beyond that the oldest is "
                   "dropped and counted.");
    fields.integer(
        "sample_queue", sample_queue, {100, 1000000}, "samples",
        "Samples of one topic that may wait for a slow disk; beyond that the oldest is dropped and counted.");
  }

  void describe_files(service::Fields& fields) {
    fields.choice("compression", compression, {"zstd", "lz4", "none"},
                  "What gets smaller by it is stored so; lz4 is for full pictures: less work, larger files.");
    fields.number("chunk_mb", chunk_mb, {0.01, 64}, "MB", "Samples are written to the disk in chunks of this size.");
    fields.number("chunk_age_s", chunk_age_s, {0.05, 60}, "s",
                  "A chunk is written at the latest after this time; a crash loses no more.");
    fields.number("sync_period_s", sync_period_s, {0.1, 600}, "s",
                  "The file is forced to the disk in this period; a power cut loses no more.");
    fields.number("keep_free_mb", keep_free_mb, {0, 1e7}, "MB",
                  "Recording stops when the disk has less free space than this.");
    fields.number("quota_mb", quota_mb, {0, 1e9}, "MB",
                  "The oldest recordings in the folder that are not protected are removed, also while recording, until "
                  "all together take no more; 0 = never.");
    fields.number(
        "split_mb", split_mb, {0, 1e7}, "MB",
        "A new file is begun at this size; calibrations and other standing values are repeated in it; 0 = never.");
    fields.number("split_min", split_min, {0, 1e5}, "min",
                  "A new file is begun after this time; 0 = never. With `file` there is only that one.");
  }

  void describe_events(service::Fields& fields) {
    fields.list("events", events,
                "Rules that say what is an event: TOPIC.FIELD OP VALUE (train_state.integrity != ok), or TOPIC.");
    fields.number("ring_s", ring_s, {0, 600}, "s",
                  "An event gets a protected file of its own that reaches back this far; 0 = it is only marked in the "
                  "recording.");
    fields.number("after_s", after_s, {0, 600}, "s", "... and goes on this long after the event.");
    fields.number("ring_mb", ring_mb, {1, 1e6}, "MB",
                  "Memory for what an event reaches back to; with less than ring_s needs it reaches back less.");
    fields.choice("ring_pictures", ring_pictures, {"full", "jpeg", "none"}, "Pictures around an event.");
    fields.number("events_mb", events_mb, {0, 1e9}, "MB",
                  "Files of events may take this much together; beyond it rules only mark the recording, and only "
                  "people get more files.");
  }
};

}  // namespace railfix::recorder
