// MCAP files: opened, every message read and taken apart by its IDL, checked, and recovered into a sound file.
#include "cdr/decode.hpp"
#include "fuzz/fuzz_target.hpp"
#include "fuzz/input_file.hpp"
#include "mcap/check.hpp"
#include "mcap/reader.hpp"

namespace railfix::mcap {

namespace {

uint64_t read_all(Reader& reader) {
  uint64_t messages = 0;
  reader.for_each({}, [&](const Channel& channel, const Message& message) {
    ++messages;
    const auto schema = reader.schemas().find(channel.schema_id);
    if (schema != reader.schemas().end())
      (void)cdr::decode(cdr::own_types(), schema->second.name, {message.data.begin(), message.data.end()});
    return true;
  });
  return messages;
}

void recording(std::span<const uint8_t> bytes) {
  static const fuzz::InputFolder folder;
  const auto file = folder.write("a.mcap", bytes);
  (void)check(file);
  const auto opened = Reader::open(file);
  if (!opened.ok()) return fuzz::require(!opened.error().message.empty(), "a refusal says why");
  const uint64_t messages = read_all(*opened.value());
  const auto out = folder.at("out.mcap");
  if (!recover(file, out).ok()) return;
  const auto recovered = Reader::open(out);
  fuzz::require(recovered.ok() && recovered.value()->indexed(), "a recovered file is a proper one");
  const uint64_t kept = read_all(*recovered.value());
  fuzz::require(kept >= messages || !opened.value()->problems().empty(), "nothing of a sound file is lost");
  fuzz::require(recovered.value()->problems().empty(), "a recovered file has no damage");
}

}  // namespace

}  // namespace railfix::mcap

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  railfix::mcap::recording({data, size});
  return 0;
}
