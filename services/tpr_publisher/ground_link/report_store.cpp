#include "tpr_publisher/ground_link/report_store.hpp"

#include <sqlite3.h>
#include <sys/statvfs.h>
#include <zlib.h>

#include <algorithm>
#include <random>

#include "core/joined.hpp"
#include "core/whole_file.hpp"

namespace railfix::tpr_publisher {

namespace {

namespace fs = std::filesystem;

int64_t checksum(std::span<const uint8_t> bytes) {
  return static_cast<int64_t>(crc32(0, bytes.data(), static_cast<uInt>(bytes.size())));
}

struct Finish {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
struct Close {
  void operator()(sqlite3* handle) const { sqlite3_close(handle); }
};

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// The first is FILE.damaged.
fs::path aside(const fs::path& file, int number) {
  return file.string() + ".damaged" + (number == 1 ? "" : "-" + std::to_string(number));
}

/// Also where one between them was taken away.
std::vector<std::string> lying_aside(const fs::path& file) {
  std::vector<std::string> there;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder_of(file), failed)) {
    const auto name = entry.path().filename().string();
    const bool is_part = name.ends_with("-wal") || name.ends_with("-shm");
    if (name.starts_with(aside(file, 1).filename().string()) && !is_part) there.push_back(entry.path().string());
  }
  std::ranges::sort(there);
  return there;
}

/// Beside those of before, which may hold reports that nobody has yet; empty = cannot be moved.
fs::path move_aside(const fs::path& file) {
  std::error_code failed;
  int number = 1;
  while (fs::exists(aside(file, number), failed)) ++number;
  const auto to = aside(file, number);
  fs::rename(file, to, failed);
  if (failed) return {};
  for (const char* part : {"-wal", "-shm"}) fs::remove(to.string() + part, failed);  // of nobody's
  fs::rename(file.string() + "-wal", to.string() + "-wal", failed);                  // may be missing
  fs::remove(file.string() + "-shm", failed);
  return to;
}

/// SQLite's words for it are an error of the disk.
bool disk_is_read_only(const fs::path& file) {
  struct statvfs disk {};
  return statvfs(folder_of(file).c_str(), &disk) == 0 && (disk.f_flag & ST_RDONLY) != 0;
}

}  // namespace

struct ReportStore::Database {
  std::unique_ptr<sqlite3, Close> handle;
  std::string file;
  bool check_failed = false;  // SQLite itself calls that no error

  [[nodiscard]] core::Error error() const {
    return {file + ": " + sqlite3_errmsg(handle.get()) + (disk_is_read_only(file) ? "; its disk is read-only." : ".")};
  }
  [[nodiscard]] bool damaged() const {
    const int code = sqlite3_errcode(handle.get());
    return check_failed || code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
  }

  core::Status run(const char* sql) const {
    if (sqlite3_exec(handle.get(), sql, nullptr, nullptr, nullptr) == SQLITE_OK) return {};
    return error();
  }
  [[nodiscard]] std::unique_ptr<sqlite3_stmt, Finish> prepare(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(handle.get(), sql, -1, &statement, nullptr);
    return std::unique_ptr<sqlite3_stmt, Finish>(statement);
  }
};

core::Status ReportStore::begin(const fs::path& file) {
  database_ = std::make_shared<Database>();
  database_->file = file.string();
  sqlite3* handle = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
  const int code = sqlite3_open_v2(file.c_str(), &handle, flags, nullptr);
  database_->handle.reset(handle);
  if (code != SQLITE_OK) return database_->error();
  // Exclusive: two services with one store would send everything twice.
  const auto ready = database_->run(
      "PRAGMA page_size=1024; PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL;"
      "CREATE TABLE IF NOT EXISTS stream (id INTEGER NOT NULL);"
      "CREATE TABLE IF NOT EXISTS report (sequence INTEGER PRIMARY KEY AUTOINCREMENT, checksum INTEGER NOT NULL,"
      " bytes BLOB NOT NULL);");
  if (!ready.ok()) return ready;
  const auto check = database_->prepare("PRAGMA quick_check(1)");
  if (!check || sqlite3_step(check.get()) != SQLITE_ROW) return database_->error();
  if (std::string(reinterpret_cast<const char*>(sqlite3_column_text(check.get(), 0))) != "ok") {
    database_->check_failed = true;
    return core::Error{file.string() + ": damaged."};
  }
  const auto stream = database_->prepare("SELECT id FROM stream");
  if (!stream) return database_->error();
  if (sqlite3_step(stream.get()) == SQLITE_ROW) {
    stream_ = static_cast<uint64_t>(sqlite3_column_int64(stream.get(), 0));
    return {};
  }
  stream_ = new_stream();
  const auto insert = database_->prepare("INSERT INTO stream VALUES (?)");
  if (!insert) return database_->error();
  sqlite3_bind_int64(insert.get(), 1, static_cast<sqlite3_int64>(stream_));
  return sqlite3_step(insert.get()) == SQLITE_DONE ? core::Status() : core::Status(database_->error());
}

uint64_t ReportStore::new_stream() {
  std::random_device device;
  return uint64_t{device()} << 32U | device();
}

core::Result<ReportStore> ReportStore::open(const fs::path& file) {
  ReportStore store;
  const auto before = lying_aside(file);
  if (!before.empty()) {
    store.remark_ = "Damaged stores of unsent reports lie in " + core::joined(before) +
                    ": look at what can be read of them, then take them away.";
  }
  const auto begun = store.begin(file);
  if (begun.ok()) return store;
  const bool damaged = store.database_->damaged();
  const auto counted = damaged ? store.counted() : "";
  store.database_.reset();
  if (!damaged) return begun.error();
  // SQLite calls it damage when the disk gives EIO, too: it may be whole.
  if (const auto whole = core::read_whole(file); !whole.ok()) return whole.error();
  const auto to = move_aside(file);
  if (to.empty()) return begun.error();
  if (const auto again = store.begin(file); !again.ok()) return again.error();
  store.problem_ =
      "The store of unsent reports was damaged: it was moved to " + to.string() + ", with " + counted + " in it.";
  return store;
}

std::string ReportStore::counted() const {
  const auto count = database_->prepare("SELECT count(*) FROM report");
  const bool known = count && sqlite3_step(count.get()) == SQLITE_ROW;
  return known ? std::to_string(sqlite3_column_int64(count.get(), 0)) + " reports" : "reports that cannot be counted";
}

core::Result<uint64_t> ReportStore::append(std::span<const uint8_t> report) {
  const auto insert = database_->prepare("INSERT INTO report (checksum, bytes) VALUES (?, ?)");
  if (!insert) return database_->error();
  sqlite3_bind_int64(insert.get(), 1, checksum(report));
  sqlite3_bind_blob(insert.get(), 2, report.data(), static_cast<int>(report.size()), SQLITE_STATIC);
  if (sqlite3_step(insert.get()) != SQLITE_DONE) return database_->error();
  return static_cast<uint64_t>(sqlite3_last_insert_rowid(database_->handle.get()));
}

core::Status ReportStore::remove(std::span<const uint64_t> sequences) {
  if (sequences.empty()) return {};
  if (auto begun = database_->run("BEGIN"); !begun.ok()) return begun;
  {
    const auto erase = database_->prepare("DELETE FROM report WHERE sequence = ?");
    for (const uint64_t sequence : sequences) {
      if (erase) sqlite3_bind_int64(erase.get(), 1, static_cast<sqlite3_int64>(sequence));
      if (!erase || sqlite3_step(erase.get()) != SQLITE_DONE) {
        const auto error = database_->error();
        (void)database_->run("ROLLBACK");
        return error;
      }
      sqlite3_reset(erase.get());
    }
  }
  return database_->run("COMMIT");
}

core::Result<std::vector<uint64_t>> ReportStore::sequences() const {
  const auto select = database_->prepare("SELECT sequence FROM report ORDER BY sequence");
  if (!select) return database_->error();
  std::vector<uint64_t> sequences;
  int code = SQLITE_ROW;
  while ((code = sqlite3_step(select.get())) == SQLITE_ROW)
    sequences.push_back(static_cast<uint64_t>(sqlite3_column_int64(select.get(), 0)));
  if (code != SQLITE_DONE) return database_->error();
  return sequences;
}

core::Result<std::optional<std::vector<uint8_t>>> ReportStore::read(uint64_t sequence) const {
  using Report = std::optional<std::vector<uint8_t>>;
  const auto select = database_->prepare("SELECT checksum, bytes FROM report WHERE sequence = ?");
  if (!select) return database_->error();
  sqlite3_bind_int64(select.get(), 1, static_cast<sqlite3_int64>(sequence));
  const int code = sqlite3_step(select.get());
  if (code == SQLITE_DONE) return Report();
  if (code != SQLITE_ROW) return database_->error();  // SQLite calls it damage when the disk gives EIO, too
  const auto* begin = static_cast<const uint8_t*>(sqlite3_column_blob(select.get(), 1));
  std::vector<uint8_t> bytes(begin, begin + sqlite3_column_bytes(select.get(), 1));
  return sqlite3_column_int64(select.get(), 0) == checksum(bytes) ? Report(std::move(bytes)) : Report();
}

}  // namespace railfix::tpr_publisher
