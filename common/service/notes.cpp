#include "service/notes.hpp"

#include <unistd.h>

#include <fstream>
#include <sstream>

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
  const std::string fresh = path_.string() + "." + std::to_string(getpid());
  std::ofstream out(fresh, std::ios::binary);
  const bool written = out && out.write(notes.data(), static_cast<std::streamsize>(notes.size())).flush();
  out.close();
  if (!written || rename(fresh.c_str(), path_.c_str()) != 0) unlink(fresh.c_str());
}

}  // namespace railfix::service
