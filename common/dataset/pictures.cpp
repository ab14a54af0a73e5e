#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <set>

#include "core/csv.hpp"
#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "dataset/video_source.hpp"
#include "pictures/decode.hpp"

namespace railfix::dataset {
namespace {

namespace fs = std::filesystem;
using core::Error;
using core::Result;

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension;
}

bool is_picture(const fs::path& file) {
  static const std::set<std::string> kExtensions = {".png", ".jpg", ".jpeg", ".pgm"};
  return kExtensions.contains(lower_extension(file));
}

struct Entry {
  int64_t stamp_ns = 0;
  fs::path file;
};

Result<std::vector<uint8_t>> bytes_of(const fs::path& file) {
  std::error_code problem;
  const auto size = fs::file_size(file, problem);
  std::vector<uint8_t> bytes(problem ? 0 : size);
  std::ifstream in(file, std::ios::binary);
  if (problem || !in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size())))
    return Error{file.string() + " cannot be read; it is missing, or not a file that may be read"};
  return bytes;
}

core::Status decode_into(cv::Mat& picture, int type, const std::vector<uint8_t>& bytes) {
  return pictures::decode(bytes, type == CV_8UC1 ? pictures::Pixels::grey : pictures::Pixels::bgr,
                          [&](int width_px, int height_px) {
                            picture.create(height_px, width_px, type);
                            return picture.data;
                          });
}

/// Pictures in files of their own.
class FileSource : public PictureSource {
 public:
  FileSource(std::vector<Entry> entries, bool colour) : entries_(std::move(entries)), colour_(colour) {}

  MaybePicture next() override {
    if (position_ == entries_.size()) return std::optional<Picture>();
    const Entry& entry = entries_[position_++];
    Picture picture{entry.stamp_ns, entry.file.filename().string(), {}};
    const auto bytes = bytes_of(entry.file);
    if (!bytes.ok()) return bytes.error();
    core::Status read = decode_into(picture.grey, CV_8UC1, bytes.value());
    if (read.ok() && colour_) read = decode_into(picture.colour, CV_8UC3, bytes.value());
    if (!read.ok()) return Error{entry.file.string() + " " + read.error().message};
    return std::optional<Picture>(std::move(picture));
  }
  [[nodiscard]] std::optional<int64_t> next_stamp_ns() const override {
    if (position_ == entries_.size()) return std::nullopt;
    return entries_[position_].stamp_ns;
  }
  bool skip() override {
    if (position_ == entries_.size()) return false;
    ++position_;
    return true;
  }
  [[nodiscard]] std::optional<size_t> count() const override { return entries_.size(); }

 private:
  std::vector<Entry> entries_;
  bool colour_;
  size_t position_ = 0;
};

MaybeSource open_euroc(const fs::path& camera, const PictureOptions& options) {
  auto opened = core::CsvReader::open(camera / "data.csv");
  if (!opened.ok()) return opened.error();
  core::CsvReader& table = opened.value();
  const auto stamp = table.column({"timestamp", "timestamp_ns", "stamp_ns"});
  const auto name = table.column({"filename"});
  if (!stamp || !name)
    return Error{(camera / "data.csv").string() + " line 1: must name the columns timestamp and filename"};
  std::vector<Entry> entries;
  while (table.next()) {
    const auto stamp_ns = table.integer(*stamp);
    if (!stamp_ns.ok()) return stamp_ns.error();
    if (table.text(*name).empty()) return table.error("has no filename");
    entries.push_back({stamp_ns.value(), camera / "data" / table.text(*name)});
  }
  if (!table.status().ok()) return table.status().error();
  if (entries.empty()) return Error{(camera / "data.csv").string() + " lists no pictures"};
  return std::unique_ptr<PictureSource>(std::make_unique<FileSource>(std::move(entries), options.colour));
}

Result<std::vector<fs::path>> pictures_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    if (entry.is_regular_file() && is_picture(entry.path())) files.push_back(entry.path());
  }
  if (problem) return Error{folder.string() + " cannot be read: " + problem.message()};
  if (files.empty()) return Error{folder.string() + " holds no pictures (png, jpg or pgm)"};
  std::sort(files.begin(), files.end());
  return files;
}

MaybeSource open_folder(const fs::path& folder, const PictureOptions& options) {
  constexpr double kDefaultFps = 30;
  const double fps = options.fps > 0 ? options.fps : kDefaultFps;
  const auto files = pictures_in(folder);
  if (!files.ok()) return files.error();
  std::vector<Entry> entries;
  for (const fs::path& file : files.value()) {
    entries.push_back({core::to_ns(static_cast<double>(entries.size()) / fps), file});
  }
  return std::unique_ptr<PictureSource>(std::make_unique<FileSource>(std::move(entries), options.colour));
}

MaybeSource open_kitti(const fs::path& sequence, const PictureOptions& options) {
  const auto files = pictures_in(sequence / "image_0");
  if (!files.ok()) return files.error();
  const fs::path times_file = sequence / "times.txt";
  std::ifstream times(times_file);
  std::vector<Entry> entries;
  std::string line;
  while (std::getline(times, line) && entries.size() < files.value().size()) {
    double time_s = 0;
    const size_t end = line.find_last_not_of(" \t\r") + 1;
    const auto [stop, code] = std::from_chars(line.data(), line.data() + end, time_s);
    if (code != std::errc{} || stop != line.data() + end) {
      return Error{times_file.string() + " line " + std::to_string(entries.size() + 1) + ": '" + line +
                   "' is not a time in seconds"};
    }
    entries.push_back({core::to_ns(time_s), files.value()[entries.size()]});
  }
  if (entries.size() < files.value().size()) {
    return Error{times_file.string() + " has " + std::to_string(entries.size()) + " times for " +
                 std::to_string(files.value().size()) + " pictures in image_0"};
  }
  return std::unique_ptr<PictureSource>(std::make_unique<FileSource>(std::move(entries), options.colour));
}

}  // namespace

MaybeSource open_pictures(const fs::path& path, const PictureOptions& options) {
  if (!fs::exists(path))
    return Error{path.string() + " does not exist; give a dataset folder, a folder of pictures or a video"};
  if (!fs::is_directory(path)) {
    if (!is_picture(path)) return open_video(path, options);
    return std::unique_ptr<PictureSource>(std::make_unique<FileSource>(std::vector<Entry>{{0, path}}, options.colour));
  }
  for (const char* camera : {"mav0/cam0", "cam0"}) {
    if (fs::is_regular_file(path / camera / "data.csv")) return open_euroc(path / camera, options);
  }
  if (fs::is_regular_file(path / "data.csv") && fs::is_directory(path / "data")) return open_euroc(path, options);
  if (fs::is_directory(path / "mav0"))
    return Error{(path / "mav0/cam0/data.csv").string() + " does not exist; the dataset has no pictures"};
  if (fs::is_directory(path / "image_0") && fs::is_regular_file(path / "times.txt")) return open_kitti(path, options);
  return open_folder(path, options);
}

}  // namespace railfix::dataset
