#include "monitor/static_files.hpp"

#include "core/whole_file.hpp"

namespace railfix::monitor {
namespace {

namespace fs = std::filesystem;

std::string type_of(const fs::path& file) {
  static const std::map<std::string, std::string> types{{".html", "text/html; charset=utf-8"},
                                                        {".js", "text/javascript; charset=utf-8"},
                                                        {".css", "text/css; charset=utf-8"},
                                                        {".json", "application/json"},
                                                        {".svg", "image/svg+xml"},
                                                        {".png", "image/png"},
                                                        {".jpg", "image/jpeg"},
                                                        {".ico", "image/x-icon"},
                                                        {".woff2", "font/woff2"},
                                                        {".webmanifest", "application/manifest+json"},
                                                        {".txt", "text/plain; charset=utf-8"},
                                                        {".map", "application/json"}};
  const auto type = types.find(file.extension().string());
  return type == types.end() ? "application/octet-stream" : type->second;
}

// Without node no page was built; everything else works.
Response without_page() {
  Response response;
  response.type = "text/html; charset=utf-8";
  response.body =
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Railfix monitor</title>"
      "<h1>The page of the monitor was not built</h1>"
      "<p>It needs npm: install it and run <code>./dev build</code> again. What works without it: "
      "<a href=\"/healthz\">/healthz</a>, <a href=\"/metrics\">/metrics</a>, <a href=\"/api/about\">/api/about</a>, "
      "<code>railfix top</code>, and Foxglove or Lichtblick on this address as a WebSocket.</p></html>\n";
  return response;
}

}  // namespace

Response StaticFiles::get(const Request& request) const {
  if (request.method != "GET" && request.method != "HEAD") {
    return {405, "text/plain; charset=utf-8", "only GET and HEAD\n", "", "no-store"};
  }
  const bool front = request.path == "/" || request.path == "/index.html";
  const fs::path inside = fs::path(front ? "index.html" : request.path).relative_path().lexically_normal();
  const fs::path file = folder_ / inside;
  std::error_code failed;
  const bool outside = request.path.find('\0') != std::string::npos || inside.empty() || *inside.begin() == "..";
  if (outside || !fs::is_regular_file(file, failed)) {
    if (front) return without_page();
    return {404, "text/plain; charset=utf-8", "there is nothing here\n", "", "no-store"};
  }
  Response response;
  const auto written = fs::last_write_time(file, failed).time_since_epoch().count();
  response.etag = "\"" + std::to_string(fs::file_size(file, failed)) + "-" + std::to_string(written) + "\"";
  response.type = type_of(file);
  // Vite names what is in assets/ after its content.
  response.cache_control = *inside.begin() == "assets" ? "public, max-age=31536000, immutable" : "no-cache";
  if (request.if_none_match.find(response.etag) != std::string::npos) {
    response.status = 304;
    return response;
  }
  auto content = core::read_whole(file);
  if (!content.ok()) return {500, "text/plain; charset=utf-8", "this file cannot be read\n", "", "no-store"};
  response.body = std::move(content).value();
  return response;
}

}  // namespace railfix::monitor
