#include "ground_link/name_lookup.hpp"

#include <netdb.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

namespace railfix::ground_link {

namespace {

constexpr std::chrono::milliseconds kAskAgain{100};

struct Answer {
  std::mutex mutex;
  std::condition_variable come;
  std::optional<int> code;
};

int ask(const std::string& host) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int code = getaddrinfo(host.c_str(), nullptr, &wanted, &found);
  if (code == 0) freeaddrinfo(found);
  return code;
}

}  // namespace

core::Status look_up(const std::string& host, const std::function<bool()>& stopped) {
  const auto answer = std::make_shared<Answer>();
  std::thread([answer, host] {
    const int code = ask(host);
    const std::lock_guard lock(answer->mutex);
    answer->code = code;
    answer->come.notify_all();
  }).detach();
  std::unique_lock lock(answer->mutex);
  while (!answer->code && !stopped()) answer->come.wait_for(lock, kAskAgain);
  if (!answer->code) return core::Error{"the name server has not answered"};
  if (*answer->code != 0) return core::Error{gai_strerror(*answer->code)};
  return {};
}

}  // namespace railfix::ground_link
