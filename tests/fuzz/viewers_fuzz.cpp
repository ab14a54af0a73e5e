// What viewers send to the monitor: the Foxglove protocol, our own of /api/live, and URLs. The first byte of the input
// chooses.
#include "fuzz/fuzz_target.hpp"
#include "monitor/foxglove_api.hpp"
#include "monitor/http_server.hpp"
#include "monitor/live_api.hpp"
#include "unit/monitor/noted_client.hpp"

namespace railfix::monitor {

namespace {

/// Every line is a message; what the server says must be JSON or binary.
template <class Send>
void lines(const std::string& text, const std::shared_ptr<NotedClient>& client, const Send& send) {
  size_t begin = 0;
  while (begin < text.size()) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    send(text.substr(begin, end - begin));
    begin = end + 1;
  }
  for (const auto& frame : client->frames) {
    if (!frame.binary) fuzz::require(nlohmann::json::accept(*frame.bytes), "what is sent is JSON");
  }
}

void foxglove(const std::string& text, bool binary) {
  FoxgloveApi api({"test",
                   {{"session", "1"}},
                   [] {},
                   [](const std::string&) {
                     return std::vector<FoxgloveMessage>{{5, "old"}};
                   }});
  const auto client = std::make_shared<NotedClient>(1);
  api.set_channels({{"state", "cdr", "railfix::msg::TrainState", "module railfix {};", "omgidl", false},
                    {"picture", "protobuf", "foxglove.CompressedImage", "\x01\x02\xff", "protobuf", true}});
  api.opened(client);
  lines(text, client, [&](const std::string& message) {
    api.message(client, message, binary);
    api.publish("state", {1, "sample"});
    api.publish("picture", {2, "sample"});
  });
  api.closed(client);
  fuzz::require(api.watched().empty(), "nobody watches any more");
}

void live(const std::string& text) {
  LiveApi api({[] {
                 return nlohmann::json{{"type", "hello"}};
               },
               [](const std::string& kind) {
                 return std::vector<nlohmann::json>{{{"type", kind}}};
               },
               [] {},
               [&](const ClientPtr& client, const ControlAsk& ask) {
                 api.reply(client->id(), ask.id, true, ask.service + ask.command + ask.argument + ask.token);
               }});
  const auto client = std::make_shared<NotedClient>(1);
  api.opened(client);
  lines(text, client, [&](const std::string& message) {
    api.message(client, message);
    for (const auto& kind : std::set<std::string>(api.watched())) api.publish(kind, {{"value", kind}});
  });
  api.closed(client);
  fuzz::require(api.watched().empty(), "nobody watches any more");
}

}  // namespace

}  // namespace railfix::monitor

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix::monitor;
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data + 1), size - 1);
  switch ((data[0] - '0') % 4) {
    case 0:
      foxglove(text, false);
      break;
    case 1:
      foxglove(text, true);
      break;
    case 2:
      live(text);
      break;
    default:
      railfix::fuzz::require(url_decoded(text).size() <= text.size(), "a URL does not grow");
  }
  return 0;
}
