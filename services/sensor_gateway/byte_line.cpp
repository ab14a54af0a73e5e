#include "sensor_gateway/byte_line.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::seconds kConnectPatience{2};

struct Baud {
  int64_t baud;
  speed_t speed;
};
constexpr Baud kBauds[] = {{9600, B9600},     {19200, B19200},   {38400, B38400},   {57600, B57600},
                           {115200, B115200}, {230400, B230400}, {460800, B460800}, {921600, B921600}};
const Baud* find(int64_t baud) {
  return std::find_if(std::begin(kBauds), std::end(kBauds), [baud](const Baud& one) { return one.baud == baud; });
}

using Found = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;
Found find(const Address& address) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (getaddrinfo(address.ip.c_str(), address.port.c_str(), &hints, &found) != 0) found = nullptr;
  return {found, &freeaddrinfo};
}

core::Error why(int error) {
  return core::Error{std::strerror(error)};  // NOLINT(concurrency-mt-unsafe): glibc keeps a text for each thread
}

}  // namespace

bool is_address(const Address& address) {
  return !address.ip.empty() && !address.port.empty() && find(address) != nullptr;
}

bool is_baud(int64_t baud) {
  return find(baud) != std::end(kBauds);
}

ByteLine::ByteLine() : cancelled_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

ByteLine::~ByteLine() {
  close();
  ::close(cancelled_);
}

core::Status ByteLine::connect(const Address& address) {
  close();
  const auto found = find(address);
  if (!found) return core::Error{"it is no address"};
  file_ = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (file_ < 0) return why(errno);
  if (::connect(file_, found->ai_addr, found->ai_addrlen) == 0) return {};
  if (errno != EINPROGRESS) return why(errno);
  if (!wait_for(POLLOUT, kConnectPatience)) return core::Error{"it does not answer"};
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(file_, SOL_SOCKET, SO_ERROR, &error, &size);
  return error == 0 ? core::Status() : why(error);
}

core::Status ByteLine::open_serial(const std::string& device, int64_t baud) {
  close();
  file_ = open(device.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (file_ < 0) return why(errno);
  termios line{};
  if (tcgetattr(file_, &line) != 0) return core::Error{"it is no serial line"};
  cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  line.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS);
  if (cfsetspeed(&line, find(baud)->speed) != 0 || tcsetattr(file_, TCSANOW, &line) != 0) return why(errno);
  ioctl(file_, TIOCEXCL);  // does not hold up root, nor who has it open already
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) return core::Error{"another program has it"};
  tcflush(file_, TCIFLUSH);
  return {};
}

core::Status ByteLine::write(std::string_view text) {
  const ssize_t sent = ::write(file_, text.data(), text.size());
  if (sent == static_cast<ssize_t>(text.size())) return {};
  return sent < 0 ? why(errno) : core::Error{"it takes no requests"};
}

core::Result<size_t> ByteLine::read(std::span<uint8_t> bytes, std::chrono::milliseconds patience) {
  if (!wait_for(POLLIN, patience)) return size_t{0};
  const ssize_t got = ::read(file_, bytes.data(), bytes.size());
  if (got > 0) return static_cast<size_t>(got);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return size_t{0};
  return got == 0 ? core::Error{"it has ended"} : why(errno);
}

void ByteLine::close() {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

void ByteLine::cancel() {
  eventfd_write(cancelled_, 1);
}

bool ByteLine::wait_for(short events, std::chrono::milliseconds patience) const {
  pollfd waits[] = {{file_, events, 0}, {cancelled_, POLLIN, 0}};
  return poll(waits, 2, static_cast<int>(patience.count())) > 0 && waits[1].revents == 0;
}

}  // namespace railfix::sensor_gateway
