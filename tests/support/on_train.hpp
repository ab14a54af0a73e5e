// A test's own place on the network of the train under test.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/run_until.hpp"

namespace railfix::test {

/// A fixture inherits it: it listens, and handles what comes while it waits.
class OnTrain {
 public:
  OnTrain(const OnTrain&) = delete;
  OnTrain& operator=(const OnTrain&) = delete;

 protected:
  OnTrain(std::string train, int64_t domain) : train_(std::move(train)), participant_(network(train_, domain)) {}
  ~OnTrain() = default;

  /// The handler takes the sample, or the sample and its SampleInfo. The reader stays as long as the fixture.
  template <class T, class Handler>
  const messaging::Reader<T>& listen(const messaging::Topic<T>& topic, Handler handler,
                                     const std::string& instance = "") {
    auto reader = std::make_shared<messaging::Reader<T>>(participant_, topic, instance, queue_, std::move(handler));
    readers_.push_back(reader);
    return *reader;
  }
  /// Handles what comes until the condition holds; false when that takes too long.
  template <class Condition>
  bool run_until(Condition condition, double patience_s = kPatienceS) {
    return test::run_until(queue_, condition, patience_s);
  }

  const std::string train_;
  messaging::Queue queue_;
  messaging::Participant participant_;

 private:
  std::vector<std::shared_ptr<void>> readers_;
};

}  // namespace railfix::test
