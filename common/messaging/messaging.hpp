// Typed DDS writers and readers. The only folder that knows Fast DDS; everything else sees the classes of this header.
//
// Threads: samples arrive in threads of the middleware, which only take them and put them into a Queue; handlers run
// where the queue is drained. A Writer may be used by one thread at a time.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "messaging/connected.hpp"
#include "messaging/qos.hpp"

namespace railfix::messaging {

/// Thrown by what makes a reader or writer whose samples lie in shared memory: nothing is wrong with its settings, and
/// once there is room it can be made. A program that ends for it has exit code 1.
class NoRoom : public core::BadInput {
 public:
  using core::BadInput::BadInput;
};

/// When a sample was sent and when it came, in the hosts' clocks; these may be set.
struct SampleInfo {
  int64_t source_ns = 0;
  int64_t received_ns = 0;
  int64_t arrived_ns = 0;  // the same as received_ns by this host's monotonic clock
  uint64_t sequence = 0;   // counts the writer's samples; a step other than 1 means that some never came
  uint64_t writer = 0;     // tells one writer from another
};

/// What the middleware needs to know of a message type, behind a wall.
class Type {
 public:
  virtual ~Type() = default;
  [[nodiscard]] virtual std::string name() const = 0;  // "railfix::msg::TrackView"
  [[nodiscard]] virtual bool keyed() const = 0;
  [[nodiscard]] virtual std::vector<uint8_t> serialize(const void* sample) const = 0;
  virtual bool deserialize(const std::vector<uint8_t>& cdr, void* sample) const = 0;
  [[nodiscard]] virtual std::shared_ptr<void> make() const = 0;
};
template <class T>
const Type& type_of();

/// One line of the table in topics.hpp.
template <class T>
struct Topic {
  const char* name;
  const char* idl;  // file in idl/ without .idl
  QosProfile qos;
  size_t reader_queue;  // samples that may wait in front of a handler; the oldest goes first
};
struct TopicInfo {
  std::string name;
  std::string idl;
  QosProfile qos;
  size_t reader_queue = 0;
  const Type* type = nullptr;
};
template <class T>
TopicInfo info_of(const Topic<T>& topic) {
  return {topic.name, topic.idl, topic.qos, topic.reader_queue, &type_of<T>()};
}

struct ParticipantOptions {
  std::string train_id = "demo";  // the partition: trains on one network never see each other
  std::string host = "local";
  std::string service = "tool";
  int64_t domain = 0;
  std::string qos_profiles;                  // Fast DDS XML that replaces the compiled-in profiles, empty = none
  std::vector<std::string> interfaces = {};  // names or addresses of those that DDS uses, empty = all
  std::vector<std::string> peers = {};  // addresses of the train's other hosts, asked where multicast does not pass
  std::string security_folder = {};     // this service's keys (see security.hpp), empty = DDS without security
};

/// Samples that this participant has sent to a topic. SampleInfo::sequence of the last one is the same number.
struct Sent {
  std::string topic;  // with its instance: "camera_frame/cam0"
  uint64_t samples = 0;
};

/// When the certificate runs out that a process of this train joined with.
struct CertificateEnd {
  std::string process;  // "odometry@cab"
  int64_t ends_ns = 0;
};

/// This process on the train's DDS network. Must outlive its writers and readers.
class Participant {
 public:
  /// Throws BadInput when the network cannot be joined or the XML cannot be read.
  explicit Participant(const ParticipantOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] Connections connections() const;
  /// To be asked several times a second, by one thread. False where Fast DDS has been at one message of the discovery
  /// for more than five seconds: 2.9.1 can wait for itself there (eProsima/Fast-DDS#6502), and only a new process gets
  /// out of it.
  [[nodiscard]] bool discovery_goes_on(int64_t now_ns);
  /// An interface of ParticipantOptions::interfaces has got a carrier since this participant joined without it; only a
  /// new participant will use it.
  [[nodiscard]] bool interface_appeared() const;
  /// Names of all topics of this train that have a writer now, sorted ("camera_frame/cam0", ...).
  [[nodiscard]] std::vector<std::string> written_topics() const;
  /// Of all processes that are there now, this one included; none on a train without security.
  [[nodiscard]] std::vector<CertificateEnd> certificates() const;
  /// By own writers, in the order in which they were made.
  [[nodiscard]] std::vector<Sent> sent() const;

  struct Impl;
  [[nodiscard]] Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Handlers waiting to run. Any thread may push; one thread drains.
class Queue {
 public:
  /// One origin of work with a limit of its own; beyond it the oldest waiting item of the source is dropped.
  struct Source {
    size_t limit = 0;  // 0 = no limit
    size_t waiting = 0;
    uint64_t dropped = 0;
  };
  void push(Source* source, std::function<void()> work);
  /// Runs one item, waiting for it until the deadline (monotonic ns). False when there was none.
  bool run_one(int64_t deadline_ns);
  /// Forgets everything of a source (its reader goes away).
  void forget(const Source* source);
  /// Samples of this source dropped so far.
  [[nodiscard]] uint64_t dropped(const Source& source) const;
  /// Samples dropped since the last call, over all sources.
  uint64_t take_dropped();

 private:
  struct Item {
    Source* source;
    std::function<void()> work;
  };
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<Item> items_;
  uint64_t dropped_ = 0;
};

/// Type-erased writer; most code uses Writer<T>.
class AnyWriter {
 public:
  /// Throws BadInput when the writer cannot be made (quality of service, permissions).
  AnyWriter(Participant& participant, const TopicInfo& topic, const std::string& instance = "");
  /// False when the sample could not be sent.
  bool write(const void* sample);
  /// Fills a sample in shared memory in place where the topic allows it, in a scratch sample otherwise.
  bool write_in_place(const std::function<void(void*)>& fill);
  [[nodiscard]] int matched_readers() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

template <class T>
class Writer {
 public:
  Writer(Participant& participant, const Topic<T>& topic, const std::string& instance = "")
      : writer_(participant, info_of(topic), instance) {}
  bool write(const T& sample) { return writer_.write(&sample); }
  /// `fill` must set every member: the memory holds an older sample.
  bool write_in_place(const std::function<void(T&)>& fill) {
    return writer_.write_in_place([&](void* sample) { fill(*static_cast<T*>(sample)); });
  }
  [[nodiscard]] int matched_readers() const { return writer_.matched_readers(); }

 private:
  AnyWriter writer_;
};

/// Type-erased reader; the handler gets a sample that stays valid as long as the pointer is kept.
class AnyReader {
 public:
  using Handler = std::function<void(const std::shared_ptr<const void>&, const SampleInfo&)>;
  AnyReader(Participant& participant, const TopicInfo& topic, const std::string& instance, Queue& queue,
            Handler handler);
  ~AnyReader();
  AnyReader(const AnyReader&) = delete;
  AnyReader& operator=(const AnyReader&) = delete;
  [[nodiscard]] int matched_writers() const;
  /// Samples dropped in front of the handler since the reader was made.
  [[nodiscard]] uint64_t dropped() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <class T>
class Reader {
 public:
  Reader(Participant& participant, const Topic<T>& topic, const std::string& instance, Queue& queue,
         std::function<void(const T&)> handler)
      : Reader(participant, topic, instance, queue,
               [handler = std::move(handler)](const T& sample, const SampleInfo&) { handler(sample); }) {}
  Reader(Participant& participant, const Topic<T>& topic, const std::string& instance, Queue& queue,
         std::function<void(const T&, const SampleInfo&)> handler)
      : reader_(participant, info_of(topic), instance, queue,
                [handler = std::move(handler)](const std::shared_ptr<const void>& sample, const SampleInfo& info) {
                  handler(*static_cast<const T*>(sample.get()), info);
                }) {}
  [[nodiscard]] int matched_writers() const { return reader_.matched_writers(); }
  [[nodiscard]] uint64_t dropped() const { return reader_.dropped(); }

 private:
  AnyReader reader_;
};

}  // namespace railfix::messaging
