// Every kind of map source; the first byte of the input chooses the kind. What was stored is read again,
// and a refusal is a sentence.
#include <array>

#include "fuzz/fuzz_target.hpp"
#include "fuzz/input_file.hpp"
#include "track/import/build.hpp"

namespace railfix::track {

namespace {

constexpr std::array kNames{"a.map", "a.landxml", "a.railml", "a.osm", "a.json", "a.geojson", "a.osm.pbf", "a.xml"};

void maps(std::span<const uint8_t> text, const char* name) {
  static const fuzz::InputFolder folder;
  const auto built = build_map({folder.write(name, text)}, {});
  if (!built.ok()) return fuzz::require(!built.error().message.empty(), "a refusal says why");
  const Map& map = built.value().map;
  const auto saved = map.save(folder.at("out.map"));
  if (!saved.ok()) return fuzz::require(!saved.error().message.empty(), "a refusal says why");
  const auto again = Map::load(folder.at("out.map"));
  fuzz::require(again.ok() && again.value().edges.size() == map.edges.size(), "a stored map is read again");
}

}  // namespace

}  // namespace railfix::track

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  using railfix::track::kNames;
  railfix::track::maps({data + 1, size - 1}, kNames[(data[0] - '0') % kNames.size()]);
  return 0;
}
