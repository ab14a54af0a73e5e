#include "track/import/xml/xml_root.hpp"

#include <expat.h>

#include <array>
#include <fstream>
#include <memory>
#include <string_view>

namespace railfix::track {
namespace {

struct Search {
  XML_Parser parser = nullptr;
  std::string root;
};

void on_start(void* data, const XML_Char* name, const XML_Char** attributes) {
  auto& search = *static_cast<Search*>(data);
  const std::string_view whole = name;
  search.root.append("<").append(whole.substr(whole.find(':') + 1));  // npos + 1 = 0
  for (; *attributes != nullptr; attributes += 2) search.root.append(" ").append(attributes[1]);
  XML_StopParser(search.parser, XML_FALSE);
}

/// Of encodings that expat does not know every byte is a letter: the names looked for are ASCII.
int on_encoding(void* /*data*/, const XML_Char* /*name*/, XML_Encoding* encoding) {
  for (int i = 0; i < 256; ++i) encoding->map[i] = i;
  encoding->data = nullptr;
  encoding->convert = nullptr;
  encoding->release = nullptr;
  return XML_STATUS_OK;
}

}  // namespace

std::string xml_root(const std::filesystem::path& file) {
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr), &XML_ParserFree);
  Search search{parser.get(), {}};
  XML_SetUserData(parser.get(), &search);
  XML_SetStartElementHandler(parser.get(), on_start);
  XML_SetUnknownEncodingHandler(parser.get(), on_encoding, nullptr);
  std::ifstream stream(file, std::ios::binary);
  std::array<char, 4096> part{};
  std::string head;
  stream >> std::ws;  // pugixml takes it before the declaration, too
  while (stream) {
    stream.read(part.data(), part.size());
    if (head.empty()) head.assign(part.data(), static_cast<size_t>(stream.gcount()));
    if (XML_Parse(parser.get(), part.data(), static_cast<int>(stream.gcount()), stream.eof() ? 1 : 0) != XML_STATUS_OK)
      break;
  }
  return search.root.empty() ? head : search.root;
}

}  // namespace railfix::track
