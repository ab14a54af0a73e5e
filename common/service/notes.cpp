#include "service/notes.hpp"

#include <fstream>
#include <sstream>

#include "core/whole_file.hpp"

namespace railfix::service {

std::filesystem::path notes_path(const CommonConfig& common, const std::string& service) {
  return "/dev/shm/railfix-notes-" + common.train_id + "-" + common.host + "-" + service;
}

Notes::Notes(std::filesystem::path path) : path_(std::move(path)) {
  std::stringstream text;
  text << std::ifstream(path_, std::ios::binary).rdbuf();
  kept_ = text.str();
}

void Notes::keep(const std::string& notes) {
  (void)core::write_whole(path_, notes);  // of a full /dev/shm the monitor tells
}

}  // namespace railfix::service
