// How the records of a chunk are stored.
#pragma once

#include <string>

#include "core/result.hpp"
#include "mcap/records.hpp"

namespace railfix::mcap {

/// zstd packs best; lz4 costs least and is for raw pictures; see docs/figures.md for both.
enum class Compression { none, zstd, lz4 };

/// As the format names it: "", "zstd" or "lz4".
const char* name_of(Compression compression);

/// One zstd or LZ4 frame; empty when that would not be smaller, or for Compression::none. `zstd_level`: 1 costs least
/// time, above 3 gains little on CDR samples.
Bytes compress(ByteView bytes, Compression compression, int zstd_level = 1);

/// Whether a chunk with this head can be unpacked, as far as that tells; the error is a clause.
core::Status check_head(const ChunkHead& head, uint64_t stored_bytes);

/// The records of a chunk, decompressed and checked against its CRC; the error is a clause ("its checksum is wrong").
core::Result<Bytes> chunk_records(const ChunkHead& head, ByteView stored_records);

}  // namespace railfix::mcap
