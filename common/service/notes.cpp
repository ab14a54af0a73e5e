#include "service/notes.hpp"

#include "core/whole_file.hpp"

namespace railfix::service {

std::filesystem::path notes_path(const CommonConfig& common, const std::string& service) {
  return "/dev/shm/railfix-notes-" + common.train_id + "-" + common.host + "-" + service;
}

Notes::Notes(std::filesystem::path path) : path_(std::move(path)) {
  if (auto text = core::read_whole(path_); text.ok()) kept_ = std::move(text).value();
}

void Notes::keep(const std::string& notes) {
  (void)core::write_whole(path_, notes);  // of a full /dev/shm the monitor tells
}

}  // namespace railfix::service
