// Where pictures come from: lists of them (EuRoC, KITTI) and the pictures themselves, in grey and in colour. The first
// byte of the input chooses.
#include "dataset/dataset.hpp"
#include "fuzz/fuzz_target.hpp"
#include "fuzz/input_file.hpp"
#include "pictures/decode.hpp"

namespace railfix {

namespace {

using Bytes = std::span<const uint8_t>;

/// To its end, whatever is broken or missing on the way.
void play(const std::filesystem::path& sequence) {
  const auto opened = dataset::open_pictures(sequence, {.fps = 0, .colour = true});
  if (!opened.ok()) return fuzz::require(!opened.error().message.empty(), "a refusal says why");
  auto& source = *opened.value();
  const size_t count = source.count().value();
  for (size_t i = 0; i < count; ++i) {
    fuzz::require(source.next_stamp_ns().has_value(), "a list says when its pictures are");
    const auto next = source.next();
    if (!next.ok()) {
      fuzz::require(!next.error().message.empty(), "a broken picture says why");
    } else {
      fuzz::require(next.value() && !next.value()->grey.empty(), "what is listed is given");
    }
  }
  const auto end = source.next();
  fuzz::require(end.ok() && !end.value() && !source.skip(), "a list ends");
}

void picture(Bytes file) {
  for (const auto pixels : {pictures::Pixels::grey, pictures::Pixels::bgr}) {
    std::unique_ptr<uint8_t[]> memory;  // not filled: a broken head may ask for much
    const auto decoded = pictures::decode(file, pixels, [&](int width_px, int height_px) {
      const size_t channels = pixels == pictures::Pixels::grey ? 1 : 3;
      memory.reset(new uint8_t[static_cast<size_t>(width_px) * static_cast<size_t>(height_px) * channels]);
      return memory.get();
    });
    if (!decoded.ok()) fuzz::require(!decoded.error().message.empty(), "a refusal says why");
    fuzz::require(!decoded.ok() || memory != nullptr, "a picture has pixels");
  }
}

}  // namespace

}  // namespace railfix

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix;
  if (size == 0) return 0;
  static const fuzz::InputFolder folder;
  const Bytes rest{data + 1, size - 1};
  static const std::string kPicture = "P5 3 2 255\nabcdef";
  const Bytes small{reinterpret_cast<const uint8_t*>(kPicture.data()), kPicture.size()};
  switch (data[0] % 3) {
    case 0:
      (void)folder.write("euroc/mav0/cam0/data/a.pgm", small);
      (void)folder.write("euroc/mav0/cam0/data.csv", rest);
      play(folder.at("euroc"));
      break;
    case 1:
      for (const char* name : {"000000.pgm", "000001.pgm"})
        (void)folder.write(std::string("kitti/image_0/") + name, small);
      (void)folder.write("kitti/times.txt", rest);
      play(folder.at("kitti"));
      break;
    default:
      picture(rest);
  }
  return 0;
}
