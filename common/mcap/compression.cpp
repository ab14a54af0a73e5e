#include "mcap/compression.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <memory>

namespace railfix::mcap {

namespace {

// A length field can be garbage: no chunk of ours comes near this, and a reader must not ask for terabytes.
constexpr uint64_t kLargestChunkBytes = uint64_t{512} << 20U;

constexpr const char* kOtherSize = "it unpacks to another size than it says";

Bytes compress_zstd(ByteView bytes, int level) {
  Bytes packed(ZSTD_compressBound(bytes.size()));
  const size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), level);
  packed.resize(ZSTD_isError(size) != 0 ? 0 : size);
  return packed;
}

Bytes compress_lz4(ByteView bytes) {
  LZ4F_preferences_t preferences{};
  preferences.frameInfo.blockSizeID = LZ4F_max4MB;
  preferences.frameInfo.contentSize = bytes.size();
  Bytes packed(LZ4F_compressFrameBound(bytes.size(), &preferences));
  const size_t size = LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), &preferences);
  packed.resize(LZ4F_isError(size) != 0 ? 0 : size);
  return packed;
}

/// Fills `records`; gives how many bytes there were, or an error's clause.
core::Result<size_t> decompress_zstd(ByteView stored, Bytes& records) {
  const size_t size = ZSTD_decompress(records.data(), records.size(), stored.data(), stored.size());
  if (ZSTD_isError(size) != 0) return core::Error{"it does not unpack: " + std::string(ZSTD_getErrorName(size))};
  return size;
}

core::Result<size_t> decompress_lz4(ByteView stored, Bytes& records) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) {
    return core::Error{"it does not unpack: no memory"};
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(made,
                                                                                     &LZ4F_freeDecompressionContext);
  size_t filled = 0;
  while (!stored.empty()) {
    size_t taken = stored.size();
    size_t given = records.size() - filled;
    const size_t wanted =
        LZ4F_decompress(context.get(), records.data() + filled, &given, stored.data(), &taken, nullptr);
    if (LZ4F_isError(wanted) != 0) return core::Error{"it does not unpack: " + std::string(LZ4F_getErrorName(wanted))};
    filled += given;
    stored = stored.subspan(taken);
    if (wanted == 0) return filled;
    if (taken == 0 && given == 0) break;
  }
  return core::Error{"it does not unpack: its LZ4 frame has no end"};
}

}  // namespace

const char* name_of(Compression compression) {
  switch (compression) {
    case Compression::none:
      return "";
    case Compression::zstd:
      return "zstd";
    case Compression::lz4:
      return "lz4";
  }
  return "";
}

Bytes compress(ByteView bytes, Compression compression, int zstd_level) {
  Bytes packed;
  if (compression == Compression::zstd) packed = compress_zstd(bytes, zstd_level);
  if (compression == Compression::lz4) packed = compress_lz4(bytes);
  if (packed.size() >= bytes.size()) packed.clear();
  return packed;
}

core::Status check_head(const ChunkHead& head, uint64_t stored_bytes) {
  if (head.uncompressed_bytes > kLargestChunkBytes) {
    return core::Error{"it claims to unpack to " + std::to_string(head.uncompressed_bytes) + " bytes"};
  }
  if (head.compression.empty() && stored_bytes != head.uncompressed_bytes) return core::Error{kOtherSize};
  if (!head.compression.empty() && head.compression != "zstd" && head.compression != "lz4") {
    return core::Error{"its compression '" + head.compression + "' is not one that Railfix reads (zstd, lz4 or none)"};
  }
  return {};
}

core::Result<Bytes> chunk_records(const ChunkHead& head, ByteView stored_records) {
  if (const auto possible = check_head(head, stored_records.size()); !possible.ok()) return possible.error();
  Bytes records;
  if (head.compression.empty()) {
    records.assign(stored_records.begin(), stored_records.end());
  } else {
    records.resize(head.uncompressed_bytes);
    const auto size =
        head.compression == "zstd" ? decompress_zstd(stored_records, records) : decompress_lz4(stored_records, records);
    if (!size.ok()) return size.error();
    records.resize(size.value());
  }
  if (records.size() != head.uncompressed_bytes) return core::Error{kOtherSize};
  if (head.crc != 0 && crc32(records) != head.crc) return core::Error{"its checksum is wrong"};
  return records;
}

}  // namespace railfix::mcap
