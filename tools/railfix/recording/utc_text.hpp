// A time of day for people and for GPX and GeoJSON.
#pragma once

#include <cstdint>
#include <ctime>
#include <string>

#include "core/time.hpp"

namespace railfix::tool {

/// "2026-11-21T17:38:02.125Z" (ISO 8601).
inline std::string utc_text(int64_t epoch_ns) {
  int64_t whole_s = epoch_ns / core::kNsPerSecond;
  int64_t rest_ns = epoch_ns % core::kNsPerSecond;
  if (rest_ns < 0) {
    rest_ns += core::kNsPerSecond;
    --whole_s;
  }
  const auto time = static_cast<time_t>(whole_s);
  tm utc{};
  gmtime_r(&time, &utc);
  char text[80];
  std::snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900, utc.tm_mon + 1,
                utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, static_cast<int>(rest_ns / 1'000'000));
  return text;
}

}  // namespace railfix::tool
