#include <fcntl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <osmium/io/any_input.hpp>
#include <osmium/io/compression.hpp>
#include <osmium/io/file.hpp>
#include <osmium/osm/box.hpp>
#include <osmium/osm/node.hpp>
#include <osmium/osm/relation.hpp>
#include <osmium/osm/way.hpp>
#include <osmium/visitor.hpp>
#include <pugixml.hpp>
#include <string_view>
#include <unordered_set>

#include "core/cut_text.hpp"
#include "track/import/osm/osm_bounds.hpp"
#include "track/import/osm/osm_data.hpp"
#include "track/import/swapped.hpp"

namespace railfix::track {
namespace {

/// A text of a PBF file can hold a zero byte, behind which osmium's own iterator misses the end of the list.
std::vector<const char*> texts_of(const osmium::TagList& list) {
  std::vector<const char*> texts;
  const char* const end = reinterpret_cast<const char*>(&list) + list.byte_size();
  for (const char* at = reinterpret_cast<const char*>(&list) + sizeof(osmium::TagList); at < end;) {
    texts.push_back(at);
    at = static_cast<const char*>(std::memchr(at, 0, static_cast<size_t>(end - at)));
    if (at == nullptr) throw std::runtime_error("a tag does not end");
    ++at;
  }
  if (texts.size() % 2 != 0) throw std::runtime_error("a tag holds a zero byte");
  return texts;
}

OsmTags tags_of(const osmium::OSMObject& object) {
  OsmTags tags;
  const auto texts = texts_of(object.tags());
  for (size_t i = 0; i < texts.size(); i += 2) tags.emplace(texts[i], texts[i + 1]);
  return tags;
}

/// The outlines of platforms with holes: their ways say nothing themselves.
std::unordered_map<int64_t, OsmTags> platform_outlines(const std::string& file, bool with_trams) {
  std::unordered_map<int64_t, OsmTags> out;
  osmium::io::Reader relations(file, osmium::osm_entity_bits::relation);
  while (const osmium::memory::Buffer buffer = relations.read()) {
    for (const osmium::Relation& relation : buffer.select<osmium::Relation>()) {
      const OsmTags tags = tags_of(relation);
      if (!is_platform_relation(tags, with_trams)) continue;
      for (const osmium::RelationMember& member : relation.members()) {
        if (member.type() == osmium::item_type::way && is_outline(member.role())) out.emplace(member.ref(), tags);
      }
    }
  }
  relations.close();
  return out;
}

/// The last bytes of a file, of what is in it where that is compressed: the whole file has to be unpacked for that.
std::string end_of(const std::filesystem::path& file, size_t bytes) {
  const osmium::io::file_compression compression = osmium::io::File(file.string()).compression();
  if (compression == osmium::io::file_compression::none) {
    std::ifstream stream(file, std::ios::binary | std::ios::ate);
    stream.seekg(std::max<std::streamoff>(0, stream.tellg() - static_cast<std::streamoff>(bytes)));
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  constexpr uintmax_t kExtract = 100'000'000;  // larger ones are whole countries, which Overpass does not give
  if (std::filesystem::file_size(file) > kExtract) return "";
  const int open_file = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);  // the decompressor closes it
  const auto unpacked = osmium::io::CompressionFactory::instance().create_decompressor(compression, open_file);
  std::string end;
  for (std::string part = unpacked->read(); !part.empty(); part = unpacked->read()) {
    end += part;
    if (end.size() > bytes) end.erase(0, end.size() - bytes);
  }
  unpacked->close();
  return end;
}

/// JOSM keeps what was deleted until it is uploaded, marked in a way that osmium does not read.
struct DeletedInJosm {
  std::unordered_set<int64_t> nodes;
  std::unordered_set<int64_t> ways;
};
DeletedInJosm deleted_in_josm(const std::string& file, const osmium::io::Header& header) {
  DeletedInJosm deleted;
  if (header.get("generator") != "JOSM") return deleted;
  pugi::xml_document document;
  const std::string text = end_of(file, std::numeric_limits<std::streamoff>::max());
  if (!document.load_buffer(text.data(), text.size())) return deleted;  // told by osmium
  for (const pugi::xml_node& object : document.child("osm").children()) {
    if (std::string_view(object.attribute("action").value()) != "delete") continue;
    const std::string_view kind = object.name();
    if (kind == "node") deleted.nodes.insert(object.attribute("id").as_llong());
    if (kind == "way") deleted.ways.insert(object.attribute("id").as_llong());
  }
  return deleted;
}

/// What the ways are comes before the nodes, and of these only what they use: a country fits into memory.
OsmData read_passes(const std::string& file, bool with_trams) {
  OsmData out;
  const std::unordered_map<int64_t, OsmTags> outlines = platform_outlines(file, with_trams);
  std::unordered_set<int64_t> wanted;
  osmium::io::Reader ways(file, osmium::osm_entity_bits::way);
  const DeletedInJosm deleted = deleted_in_josm(file, ways.header());
  while (const osmium::memory::Buffer buffer = ways.read()) {
    for (const osmium::Way& way : buffer.select<osmium::Way>()) {
      if (!way.visible() || deleted.ways.contains(way.id())) continue;
      OsmTags tags = tags_of(way);
      std::vector<OsmWay>* ways_like_it = ways_for(out, tags, with_trams);
      if (const auto outline = outlines.find(way.id()); ways_like_it == nullptr && outline != outlines.end()) {
        ways_like_it = &out.platforms;
        tags = outline->second;
      }
      if (ways_like_it == nullptr) continue;
      OsmWay& taken = ways_like_it->emplace_back(OsmWay{way.id(), {}, std::move(tags)});
      for (const osmium::NodeRef& node : way.nodes()) taken.nodes.push_back(node.ref());
      wanted.insert(taken.nodes.begin(), taken.nodes.end());
    }
  }
  ways.close();
  NodesNowhere nowhere;
  osmium::io::Reader nodes(file, osmium::osm_entity_bits::node);
  while (const osmium::memory::Buffer buffer = nodes.read()) {
    for (const osmium::Node& node : buffer.select<osmium::Node>()) {
      if (!node.visible() || deleted.nodes.contains(node.id())) continue;
      if (!node.location().valid()) {
        if (wanted.contains(node.id()))
          nowhere.add({node.location().lat_without_check(), node.location().lon_without_check()});
        continue;
      }
      OsmTags tags = tags_of(node);
      if (!wanted.contains(node.id()) && !is_mast(tags)) continue;
      out.nodes[node.id()] = {{node.location().lat(), node.location().lon()}, std::move(tags)};
    }
  }
  const osmium::Box bounds = nodes.header().joined_boxes();
  nodes.close();
  nowhere.tell(out.problems);
  if (bounds.valid()) {
    const OsmBounds declared{{bounds.bottom_left().lat(), bounds.bottom_left().lon()},
                             {bounds.top_right().lat(), bounds.top_right().lon()}};
    tell_contradiction(declared, out);
  }
  return out;
}

/// What Overpass writes at the end of XML; osmium reads over it. Empty where there is none.
std::string remark_in(const std::filesystem::path& file) {
  constexpr size_t kEnd = 4096;
  constexpr size_t kMost = 200;
  const std::string end = end_of(file, kEnd);
  const std::string tag = "<remark>";
  const size_t begin = end.find(tag);
  if (begin == std::string::npos) return "";
  const std::string remark = end.substr(begin + tag.size(), end.find('<', begin + 1) - begin - tag.size());
  return "\"" + (remark.size() > kMost ? core::cut_text(remark, kMost) + "..." : remark) + "\"";
}

/// What the library says, and what it means for the file.
std::string told(const std::filesystem::path& file, const std::string& library) {
  constexpr std::array kCutShort{
      "EOF", "end of", "no data", "read failed", "no element found", "unclosed token", "read close failed"};
  const auto says = [&](const char* text) { return library.find(text) != std::string::npos; };
  std::error_code failed;
  if (std::filesystem::file_size(file, failed) == 0) return "the file is empty (" + library + ")";
  return std::ranges::any_of(kCutShort, says) ? "the file is empty or cut short (" + library + ")" : library;
}

}  // namespace

void NodesNowhere::add(const GeoPoint& place) {
  ++count_;
  if (may_be_swapped(place)) ++swapped_;
}

void NodesNowhere::tell(std::vector<std::string>& problems) const {
  if (count_ == 0) return;
  problems.push_back(std::to_string(count_) +
                     " nodes of tracks have a latitude beyond 90 or a longitude beyond 180 degrees, or none; "
                     "their tracks lack them" +
                     (swapped_ > 0 ? std::string(": ") + kMayBeSwapped : ""));
}

std::string problem_of_remark(const std::string& quoted) {
  return "the extract may not be whole, Overpass remarks " + quoted +
         ": ask for it again, with a longer [timeout:...] or for a smaller area";
}

bool is_track(const OsmTags& tags, bool with_trams) {
  const auto railway = tags.find("railway");
  if (railway == tags.end()) return false;
  const std::string& kind = railway->second;
  return kind == "rail" || kind == "light_rail" || kind == "narrow_gauge" || kind == "subway" ||
         (with_trams && kind == "tram");
}

std::string value_of(const OsmTags& tags, const char* key) {
  const auto found = tags.find(key);
  return found == tags.end() ? std::string() : found->second;
}

std::string line_in(const OsmTags& tags) {
  const std::string name = value_of(tags, "name");
  return name.empty() ? value_of(tags, "ref") : name;
}

bool is_set(const OsmTags& tags, const char* key) {
  const std::string value = value_of(tags, key);
  return !value.empty() && value != "no" && value != "0" && value != "false";
}

bool leads_over(const OsmTags& tags, bool with_trams) {
  if (is_track(tags, with_trams) || !is_set(tags, "bridge")) return false;
  // What was, or is not yet: nobody knows whether its bridge stands.
  constexpr std::array kGone{"abandoned", "razed", "dismantled", "proposed", "construction"};
  const auto stands = [&](const char* key) {
    return is_set(tags, key) && std::find(kGone.begin(), kGone.end(), value_of(tags, key)) == kGone.end();
  };
  return stands("highway") || stands("railway") || stands("waterway");
}

bool is_platform(const OsmTags& tags, bool with_trams) {
  if (is_set(tags, "disused") || is_set(tags, "abandoned")) return false;
  const bool for_trains = is_set(tags, "train") || is_set(tags, "light_rail") || is_set(tags, "subway");
  const bool for_trams = is_set(tags, "tram");
  const std::string kind = value_of(tags, "railway");
  if (kind == "platform" || kind == "platform_edge") return for_trains || with_trams || !for_trams;
  return value_of(tags, "public_transport") == "platform" && (for_trains || (with_trams && for_trams));
}

bool is_platform_relation(const OsmTags& tags, bool with_trams) {
  return value_of(tags, "type") == "multipolygon" && is_platform(tags, with_trams);
}

bool is_mast(const OsmTags& tags) {
  return value_of(tags, "power") == "catenary_mast";
}

bool is_outline(const std::string& role) {
  return role.empty() || role == "outer";
}

std::vector<OsmWay>* ways_for(OsmData& data, const OsmTags& tags, bool with_trams) {
  if (is_track(tags, with_trams)) return &data.ways;
  if (is_platform(tags, with_trams)) return &data.platforms;
  return leads_over(tags, with_trams) ? &data.bridges : nullptr;
}

core::Result<OsmData> read_osm(const std::filesystem::path& file, bool with_trams) {
  try {
    OsmData out = read_passes(file.string(), with_trams);
    if (const std::string remark = remark_in(file); !remark.empty()) out.problems.push_back(problem_of_remark(remark));
    return out;
  } catch (const std::exception& reason) {
    return core::Error{"cannot read " + file.string() + " as OpenStreetMap data: " + told(file, reason.what())};
  }
}

}  // namespace railfix::track
