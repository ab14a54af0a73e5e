// The tables in docs/configuration say what the programs say: every key with its default, unit, range and meaning, and
// no other key. Links lead to files that are there, and tables of files name those of the service.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "../../benchmark/confidence/sensor_sets.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;

struct Key {
  std::string value;  // default as in the YAML file
  std::string range;  // "[...]" at the end of the comment, without the brackets; empty where there is none
  std::string meaning;
  std::string file;
};

const fs::path kRoot = RAILFIX_SOURCE_DIR;

std::vector<fs::path> files_below(const fs::path& folder, const std::string& extension) {
  std::vector<fs::path> files;
  fs::recursive_directory_iterator entry(folder);
  for (const fs::recursive_directory_iterator end; entry != end; ++entry) {
    if (entry->path().filename() == "node_modules") entry.disable_recursion_pending();  // other people's pages
    if (entry->path().extension() == extension) files.push_back(entry->path());
  }
  return files;
}

std::string text_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// "section.group.key" of everything in a file that `railfix-<service> --document` wrote.
void read_keys(const fs::path& file, std::map<std::string, Key>& keys) {
  static const std::regex kLine(R"(( *)(\w+):(?: (.*))?)");
  static const std::regex kComment(R"( *# (.*?)(?: \[([^\[\]]*)\])?)");
  std::ifstream stream(file);
  std::vector<std::string> groups;
  std::string comment;
  for (std::string line; std::getline(stream, line);) {
    if (line.find_first_not_of(' ') != std::string::npos && line[line.find_first_not_of(' ')] == '#') {
      comment = line;
      continue;
    }
    std::smatch part;
    if (!std::regex_match(line, part, kLine)) continue;
    groups.resize(static_cast<size_t>(part.length(1)) / 2);
    std::string path;
    for (const auto& group : groups) path += group + ".";
    if (part[3].matched) {
      std::smatch said;
      ASSERT_TRUE(std::regex_match(comment, said, kComment)) << path + part.str(2);
      keys[path + part.str(2)] = {part[3], said[2], said[1], file.filename().string()};
    } else {
      groups.push_back(part[2]);
    }
  }
}

std::map<std::string, Key> keys_of_programs() {
  std::map<std::string, Key> keys;
  for (const auto& file : files_below(kRoot / "services", ".yaml")) read_keys(file, keys);
  return keys;
}

// Without marks, of which a page has more.
std::string plain(const std::string& cell) {
  std::string text;
  for (const char c : cell) {
    if (c != '`' && c != '\\') text += c;
  }
  return text;
}

// Rows "| `section.key` | default | unit, range | meaning |" of all pages.
std::map<std::string, Key> keys_of_pages() {
  static const std::regex kRow(R"(\| `(\w+(?:\.\w+)+)` \| (?:`(.*)`|empty) \| (.*?) \| (.*) \|)");
  std::map<std::string, Key> keys;
  for (const auto& file : files_below(kRoot / "docs" / "configuration", ".md")) {
    std::ifstream stream(file);
    for (std::string line; std::getline(stream, line);) {
      std::smatch part;
      if (std::regex_match(line, part, kRow)) keys[part[1]] = {part[2], part[3], part[4], file.filename().string()};
    }
  }
  return keys;
}

TEST(ConfigurationPages, SayEveryKeyWithItsDefaultRangeAndMeaning) {
  const auto pages = keys_of_pages();
  const auto programs = keys_of_programs();
  ASSERT_GT(programs.size(), 100U);
  for (const auto& [key, program] : programs) {
    const auto page = pages.find(key);
    if (page == pages.end()) {
      ADD_FAILURE() << key << " of " << program.file << " stands on no page in docs/configuration";
      continue;
    }
    const bool empty = program.value == "\"\"" || program.value == "[]";
    EXPECT_EQ(page->second.value, empty ? "" : program.value) << "default of " << key << " in " << page->second.file;
    EXPECT_EQ(plain(page->second.meaning), plain(program.meaning)) << key << " in " << page->second.file;
    if (!program.range.empty()) {
      EXPECT_EQ(page->second.range, program.range) << "unit and range of " << key << " in " << page->second.file;
    }
  }
}

TEST(ConfigurationPages, SayNoKeyThatIsGone) {
  const auto programs = keys_of_programs();
  for (const auto& [key, page] : keys_of_pages()) {
    EXPECT_TRUE(programs.contains(key)) << key << " in " << page.file << " is no key of any service";
  }
}

// A relative link that leads nowhere is a page that has gone.
TEST(Documentation, LinksLeadSomewhere) {
  static const std::regex kLink(R"(\]\(([^)#:]+)(?:#[^)]*)?\))");
  auto pages = files_below(kRoot / "docs", ".md");
  pages.push_back(kRoot / "README.md");
  for (const char* folder : {"services", "common"}) {
    for (const auto& page : files_below(kRoot / folder, ".md")) pages.push_back(page);
  }
  for (const auto& page : pages) {
    const std::string text = text_of(page);
    for (std::sregex_iterator link(text.begin(), text.end(), kLink), end; link != end; ++link) {
      EXPECT_TRUE(fs::exists(page.parent_path() / link->str(1))) << page << " links to " << link->str(1);
    }
  }
}

// A service's page with a table of its files names all of them, or the folder they are in; what only carries data or
// configuration needs no row.
TEST(Documentation, TablesOfFilesAreComplete) {
  static const std::regex kNeedsNoRow(".*_(config|parameters|service|types)");
  for (const auto& page : files_below(kRoot / "docs" / "methods", ".md")) {
    const std::string text = text_of(page);
    if (text.find("\n## Files\n") == std::string::npos) continue;
    const fs::path service = kRoot / "services" / page.stem();
    for (const auto& header : files_below(service, ".hpp")) {
      const std::string name = header.stem().string();
      const bool folder_named = header.parent_path() != service &&
                                text.find("`" + header.parent_path().filename().string() + "/`") != std::string::npos;
      EXPECT_TRUE(folder_named || std::regex_match(name, kNeedsNoRow) ||
                  text.find("`" + name + "`") != std::string::npos)
          << page << " has no row for " << name;
    }
  }
}

// The table of what each source is worth has a row for every set that the program compares.
TEST(SourcesPage, HasARowForEverySetOfSensors) {
  const std::string page = text_of(kRoot / "docs" / "sources.md");
  for (const auto& set : train::kSensorSets) {
    EXPECT_NE(page.find("| " + std::string(set.name) + " |"), std::string::npos) << set.name;
  }
}

}  // namespace
}  // namespace railfix
