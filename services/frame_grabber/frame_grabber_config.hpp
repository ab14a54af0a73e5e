// Configuration of the frame_grabber: section `frame_grabber`.
#pragma once

#include <string>
#include <vector>

#include "frame_grabber/live_camera.hpp"
#include "frame_grabber/picture_health.hpp"
#include "service/config.hpp"

namespace railfix::frame_grabber {

struct FrameGrabberConfig {
  std::string camera = "cam0";
  std::string source;
  std::string calibration;
  double fps = 0;
  std::string pace = "real";
  std::string start = "command";
  double began_s = 0;
  std::string at_end = "idle";
  std::vector<std::string> wait_for;
  double wait_s = 20;
  int64_t read_ahead = 8;
  double preview_hz = 5;
  int64_t preview_width_px = 640;
  int64_t preview_quality = 75;
  PictureHealthConfig health;
  LiveConfig live;

  /// With the rate that is given for every kind of source.
  [[nodiscard]] LiveConfig live_config() const {
    LiveConfig config = live;
    config.rate_hz = fps;
    return config;
  }

  void describe(service::Fields& fields) {
    fields.text("camera", camera,
                "Name of the camera: the topics are camera_frame/<camera> and camera_preview/<camera>.");
    fields.text("source", source,
                "Dataset folder (EuRoC or KITTI), folder of pictures, video file, or a live camera: genicam:ID "
                "(or address, or any), capture:DEVICE, PIPELINE or URL.");
    fields.text("calibration", calibration, "Calibration file; empty = the one that lies with the pictures.");
    fields.number("fps", fps, {0, 1000}, "1/s",
                  "Rate of a folder of pictures, a video or a live camera; 0 = its own (of a video the times of its "
                  "pictures), 30 for a folder.");
    fields.choice(
        "pace", pace, {"real", "lossless"},
        "real: at the recorded rate, late pictures are skipped; lossless: the next picture when all in wait_for "
        "have used the last one.");
    fields.choice("start", start, {"command", "immediately"},
                  "Begin to play at the control command `start`, or at once.");
    fields.number("began_s", began_s, {0, 1e10}, "s",
                  "Unix time at which the first picture was taken, pace real: a program that is started again goes on "
                  "where the camera would be by now; 0 = when play begins.");
    fields.choice("at_end", at_end, {"idle", "finish"}, "Behind the last picture: stay, or end the program.");
    fields.list("wait_for", wait_for, "Services that take turns on every picture, in this order (pace lossless).");
    fields.number("wait_s", wait_s, {0.1, 3600}, "s", "Longest wait for these answers before the program gives up.");
    fields.integer("read_ahead", read_ahead, {1, 256}, "pictures", "How many pictures are decoded ahead.");
    fields.number("preview_hz", preview_hz, {0, 30}, "1/s", "Rate of the JPEG preview; 0 = none.");
    fields.integer("preview_width_px", preview_width_px, {64, 1920}, "px", "Largest width of the preview.");
    fields.integer("preview_quality", preview_quality, {1, 100}, "", "JPEG quality of the preview.");
    fields.group("health", "When a picture is flagged as bad.", [this](service::Fields& f) {
      f.number("dark_below_grey", health.dark_below_grey, {0, 255}, "grey", "Dark: 95 % of the pixels are below this.");
      f.number("saturated_share", health.saturated_share, {0.01, 1}, "",
               "Saturated: this share of the pixels is 250 or brighter.");
      f.integer("frozen_after_pictures", health.frozen_after_pictures, {1, 10000}, "pictures",
                "Frozen: so many pictures in a row equal one of the 16 before, or are the last one coded anew.");
      f.number("covered_share", health.covered_share, {0.05, 1}, "",
               "Covered: this share of the track's part of the picture shows nothing, or stands still while the rest "
               "of it moves.");
      f.number("blurred_below", health.blurred_below, {0, 1}, "",
               "Blurred: less than this share of the height of the sharpest edges lies within two pixels; 0 = never.");
      f.number("persist_s", health.persist_s, {0, 600}, "s", "Covered and blurred must last so long.");
    });
    fields.group("live", "How a live camera is set.", [this](service::Fields& f) { describe_live(f); });
  }

 private:
  void describe_live(service::Fields& f) {
    f.number("exposure_us", live.exposure_us, {0, 100000}, "us", "Exposure (genicam); 0 = the camera's automatic.");
    f.number("gain_db", live.gain_db, {-1, 60}, "dB", "Gain (genicam); negative = the camera's automatic.");
    f.text("pixel_format", live.pixel_format,
           "Mono8, Mono12p, Mono12Packed, Mono16, BayerRG8, BayerGR8, BayerGB8, BayerBG8 or BGR8 (genicam); becomes "
           "mono8.");
    f.text("trigger", live.trigger, "Trigger source of the camera, as Line1 (genicam); empty = it runs by itself.");
    f.integer("packet_size", live.packet_size, {0, 16000}, "bytes",
              "Packets of GigE cameras (genicam); 0 = found out when it connects.");
    f.integer("width_px", live.width_px, {0, 1920}, "px", "Width to ask of the camera; 0 = as it is set.");
    f.integer("height_px", live.height_px, {0, 1920}, "px", "Height to ask of the camera; 0 = as it is set.");
    f.flag("ptp", live.ptp, "The camera's clock follows the network's PTP clock, as this computer's does (genicam).");
    f.number("latency_ms", live.latency_ms, {0, 1000}, "ms",
             "From the end of exposure to the arrival of the picture's beginning; taken off the stamps.");
    f.number("silent_s", live.silent_s, {0.2, 600}, "s", "A camera without a picture for so long is connected anew.");
    f.number("reconnect_s", live.reconnect_s, {0.1, 600}, "s", "Pause between attempts to connect.");
  }
};

}  // namespace railfix::frame_grabber
