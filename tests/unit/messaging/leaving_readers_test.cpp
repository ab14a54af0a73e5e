// Readers come and go while a writer goes on, or comes and goes too: nobody is stopped by that, or crashes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <future>
#include <memory>
#include <thread>
#include <vector>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"

namespace railfix::messaging {
namespace {

constexpr int kDomain = 97;
constexpr int kReaders = 250;
constexpr int kReadersAmongWriters = 600;
constexpr std::chrono::seconds kPatience{10};

/// Ends the other thread also where this one fails.
struct Ending {
  std::atomic<bool>& ended;
  ~Ending() { ended = true; }
};

class LeavingReaders : public ::testing::Test {
 protected:
  void write() {
    while (!ended_) {
      for (int i = 0; i < 3; ++i) logs_.write({});
      std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  }
  void read() {
    for (int n = 0; n < kReaders; ++n) {
      const Reader<msg::LogRecord> reader(listening_, topics::log_record, "", queue_,
                                          [&](const msg::LogRecord&) { ++heard_; });
      const int64_t until_ns = core::monotonic_ns() + int64_t{10 + 7 * n % 40} * 1'000'000;
      while (queue_.run_one(until_ns)) continue;
    }
  }

  void come_and_go() {
    while (!ended_) {
      std::vector<std::unique_ptr<Writer<msg::TrackView>>> writers(6);
      for (auto& writer : writers) writer = std::make_unique<Writer<msg::TrackView>>(talking_, topics::track_view);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  const std::string train_ = "leaving-" + std::to_string(getpid());
  Participant talking_{test::network(train_, kDomain)};
  Participant listening_{test::network(train_, kDomain)};
  Writer<msg::LogRecord> logs_{talking_, topics::log_record};
  Queue queue_;
  int heard_ = 0;
  std::atomic<bool> ended_ = false;
};

TEST_F(LeavingReaders, DoNotStopAWriter) {
  const auto writer = std::async(std::launch::async, [&] { write(); });
  const Ending ending{ended_};
  read();
  ended_ = true;
  if (writer.wait_for(kPatience) != std::future_status::ready) {
    ADD_FAILURE() << "the writer hangs";
    std::_Exit(EXIT_FAILURE);  // nothing gets a thread back that waits inside the middleware for ever
  }
  EXPECT_GT(heard_, 0);
}

// A writer that appears is told to a reader by the middleware's thread, while ours takes the reader away.
TEST_F(LeavingReaders, AreNotToldOfWritersThatAppear) {
  const auto writers = std::async(std::launch::async, [&] { come_and_go(); });
  const Ending ending{ended_};
  uint64_t met = 0;
  for (int n = 0; n < kReadersAmongWriters; ++n) {
    std::vector<std::unique_ptr<Reader<msg::TrackView>>> readers(16);
    for (auto& reader : readers) {
      reader = std::make_unique<Reader<msg::TrackView>>(listening_, topics::track_view, "", queue_,
                                                        [](const msg::TrackView&) {});
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(n % 4));
    for (const auto& reader : readers) met += static_cast<uint64_t>(reader->matched_writers());
  }
  EXPECT_GT(met, 0U) << "they never met";
}

}  // namespace
}  // namespace railfix::messaging
