// Runs a fuzz target without libFuzzer: every seed, then RUNS mutations of them, the same on every machine.
//   railfix-fuzz-NAME SEEDS_FOLDER [RUNS]
#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "core/random.hpp"
#include "fuzz/fuzz_target.hpp"

namespace {

using Bytes = std::vector<uint8_t>;

constexpr const char* kLastInput = "fuzz-crash";  // written where the program runs when the target aborts or crashes
Bytes current;                                    // for the handler of that

std::vector<Bytes> read_seeds(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<Bytes> seeds;
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
  }
  return seeds;
}

size_t below(railfix::core::Random& random, size_t limit) {
  return limit == 0 ? 0 : random.next() % limit;
}

void change(Bytes& input, const std::vector<Bytes>& seeds, railfix::core::Random& random) {
  constexpr uint8_t kEdges[] = {0, 1, 0x7F, 0x80, 0xFE, 0xFF};
  const size_t place = below(random, input.size() + 1);
  const auto at = input.begin() + static_cast<std::ptrdiff_t>(place);
  const bool inside = place < input.size();
  switch (random.next() % 7) {
    case 0:
      if (inside) *at = static_cast<uint8_t>(*at ^ 1U << random.next() % 8);
      break;
    case 1:
      if (inside) *at = static_cast<uint8_t>(random.next());
      break;
    case 2:
      if (inside) *at = kEdges[random.next() % sizeof kEdges];
      break;
    case 3:
      input.insert(at, 1 + below(random, 8), static_cast<uint8_t>(random.next()));
      break;
    case 4:
      input.erase(at, at + static_cast<std::ptrdiff_t>(below(random, std::min<size_t>(9, input.size() - place + 1))));
      break;
    case 5:
      input.resize(place);
      break;
    default: {  // the head of this one with the tail of another
      const auto& other = seeds[below(random, seeds.size())];
      const size_t from = below(random, other.size() + 1);
      input.resize(place);
      input.insert(input.end(), other.begin() + static_cast<std::ptrdiff_t>(from), other.end());
    }
  }
}

extern "C" void keep_input(int signal) {
  std::ofstream(kLastInput, std::ios::binary)
      .write(reinterpret_cast<const char*>(current.data()), static_cast<std::streamsize>(current.size()));
  std::signal(signal, SIG_DFL);
}

}  // namespace

int main(int argc, char** argv) {
  size_t runs = 100000;
  const char* end = argc > 2 ? argv[2] + std::strlen(argv[2]) : nullptr;
  if (argc < 2 || (argc > 2 && std::from_chars(argv[2], end, runs).ptr != end)) {
    std::cerr << "usage: " << argv[0] << " SEEDS_FOLDER [RUNS]\n";
    return 2;
  }
  const auto seeds = std::filesystem::is_directory(argv[1]) ? read_seeds(argv[1]) : std::vector<Bytes>{};
  if (seeds.empty()) {
    std::cerr << argv[1] << ": no folder with seeds\n";
    return 2;
  }
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL}) std::signal(signal, keep_input);
  for (const auto& seed : seeds) {
    current = seed;
    LLVMFuzzerTestOneInput(current.data(), current.size());
  }
  railfix::core::Random random(1);
  for (size_t run = 0; run < runs; ++run) {
    current = seeds[below(random, seeds.size())];
    for (uint64_t changes = 1 + random.next() % 5; changes > 0; --changes) change(current, seeds, random);
    LLVMFuzzerTestOneInput(current.data(), current.size());
  }
  std::cout << seeds.size() << " seeds, " << runs << " mutations, no broken promise\n";
  return 0;
}
