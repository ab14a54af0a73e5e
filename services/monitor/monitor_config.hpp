// Configuration of the monitor: section `monitor`.
#pragma once

#include "messaging/security.hpp"
#include "service/config.hpp"

namespace railfix::monitor {

struct MonitorConfig {
  std::string address = "127.0.0.1";
  int64_t port = 8080;
  int64_t port_search = 20;
  int64_t foxglove_port = 8765;
  std::string page_folder;
  std::string map;
  bool control = true;
  std::string token;
  std::string token_file;
  std::string tls_certificate;
  std::string tls_key;
  double picture_hz = 5;
  double client_queue_mb = 4;
  double slow_client_s = 10;
  int64_t most_clients = 64;
  std::vector<std::string> expected = {"frame_grabber", "sensor_gateway", "track_detector", "odometry",
                                       "map_matcher",   "fusion",         "tpr_publisher",  "recorder"};
  double interval_wide_m = 100;
  double disk_low_mb = 1000;
  int64_t certificate_days = messaging::kCertificateWarningDays;

  void describe(service::Fields& fields) {
    fields.text("address", address,
                "Address of this computer that the pages are served on; 0.0.0.0 = all, for a network that is trusted.");
    fields.integer("port", port, {0, 65535}, "", "Port of page, /api, /metrics and /healthz; 0 = any that is free.");
    fields.integer("port_search", port_search, {0, 1000}, "ports",
                   "When the port is taken the ones after it are tried, this many; 0 = refuse to start.");
    fields.integer(
        "foxglove_port", foxglove_port, {-1, 65535}, "",
        "Port for Foxglove and Lichtblick besides the one above; 0 = none besides, -1 = no Foxglove at all.");
    fields.text("page_folder", page_folder, "Folder of the built page; empty = the one of this build.");
    fields.text("map", map, "Map file in use (from `railfix map build`); empty = no line is drawn.");
    fields.flag("control", control, "Whether recorder and player can be controlled from the page.");
    fields.text("token", token, "Word that control asks for; empty = control only from this computer itself.");
    fields.text("token_file", token_file, "File whose first line is that word, which then stands in no configuration.");
    fields.text("tls_certificate", tls_certificate,
                "PEM file with this computer's certificate and those above it: everything is served with TLS; empty = "
                "without.");
    fields.text("tls_key", tls_key, "PEM file with the certificate's key.");
    fields.number("picture_hz", picture_hz, {0.1, 30}, "1/s", "Most pictures that a viewer gets in a second.");
    fields.number("client_queue_mb", client_queue_mb, {0.1, 1000}, "MB",
                  "What may wait for one viewer's network; one with more is disconnected.");
    fields.number("slow_client_s", slow_client_s, {1, 600}, "s",
                  "A viewer that takes nothing for this time is disconnected.");
    fields.integer("most_clients", most_clients, {1, 10000}, "", "Viewers at a time; more are refused.");
    fields.list("expected", expected,
                "Services that must be there, SERVICE or SERVICE@HOST; a missing one is a problem.");
    fields.number("interval_wide_m", interval_wide_m, {0.1, 100000}, "m",
                  "A confidence interval wider than this is a problem.");
    fields.number("disk_low_mb", disk_low_mb, {0, 1e7}, "MB",
                  "Less free space than this on the recorder's disk is a problem.");
    fields.integer("certificate_days", certificate_days, {0, 3650}, "days",
                   "A certificate that runs out sooner than this is a problem, here and in railfix train check.");
  }
};

}  // namespace railfix::monitor
