#include "libmap/scan/sqlite_file.h"

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <mutex>
#include <string_view>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr int busy_timeout_ms = 10000;
constexpr std::string_view signature("SQLite format 3\0", 16);
// Offsets in the header (sqlite.org/fileformat2.html, 1.3).
constexpr std::size_t read_version_at = 19;
constexpr char wal_version = 2;

SQLite::Column column_of(const void* statement, int column) {
  return static_cast<const SQLite::Statement*>(statement)->getColumn(column);
}

fs::path beside(const fs::path& path, const char* suffix) { return fs::path(path).concat(suffix); }

// Returns the absolute path as a URI's path (RFC 3986); a leading "//" would denote a host.
std::string uri_of(const fs::path& path) {
  static constexpr std::string_view hex = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') ||
                          std::string_view("/-_.~").find(c) != std::string_view::npos;
    if (is_plain) {
      uri += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      uri += {'%', hex[byte >> 4], hex[byte & 15]};
    }
  }
  return uri;
}

struct OpenMode {
  std::string uri;
  const char* file_system = nullptr;  // SQLite's name of the VFS; nullptr: the default
  bool exclusive = false;
};

OpenMode open_mode(const fs::path& path, std::string_view header) {
  const std::string uri = uri_of(path);
  if (header[read_version_at] != wal_version) return {.uri = uri + "?mode=ro"};
  const bool has_wal = fs::exists(beside(path, "-wal"));
  const bool has_index = fs::exists(beside(path, "-shm"));
  if (has_wal && has_index) return {.uri = uri + "?mode=ro"};
  if (!has_wal) return {.uri = uri + "?immutable=1"};
  // In exclusive mode, SQLite keeps the index of the -wal in memory. Its lock is not possible on a
  // file that is open for reading, and not needed without other programs.
  return {.uri = uri + "?mode=ro", .file_system = "unix-none", .exclusive = true};
}

Error read_error(const fs::path& path, const SQLite::Exception& error) {
  std::string reason = std::string("cannot be read as SQLite: ") + error.what();
  if (error.getErrorCode() == SQLITE_BUSY)
    reason = "another program has locked the file for more than " +
             std::to_string(busy_timeout_ms / 1000) + " s";
  const int code = error.getExtendedErrorCode();
  if (code == SQLITE_READONLY_ROLLBACK || code == SQLITE_READONLY_RECOVERY)
    reason =
        "an interrupted write left its journal next to the file; roll it back by opening the file "
        "with write access, e.g. `sqlite3 FILE .tables`";
  return Error(reason, {.file = path.string()});
}

}  // namespace

struct SqliteFile::Connection {
  Connection(const OpenMode& mode, std::uint64_t file_bytes)
      : database(mode.uri, SQLite::OPEN_READONLY | SQLite::OPEN_URI, busy_timeout_ms,
                 mode.file_system == nullptr ? "" : mode.file_system) {
    // No value is longer than the file, except results of expressions in its schema.
    constexpr std::uint64_t min_length = 1U << 20U;
    constexpr std::uint64_t max_length = 1'000'000'000;  // SQLite's limit
    sqlite3_limit(database.getHandle(), SQLITE_LIMIT_LENGTH,
                  static_cast<int>(std::min(file_bytes + min_length, max_length)));
    // Restricts the effects of an untrusted schema.
    database.exec(
        "PRAGMA trusted_schema = OFF; PRAGMA query_only = ON; PRAGMA temp_store = MEMORY");
    if (mode.exclusive) database.exec("PRAGMA locking_mode = EXCLUSIVE");
    // Otherwise, a -wal without a valid frame is deleted when the connection closes.
    sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  }

  SQLite::Database database;
  std::mutex mutex;
};

bool SqliteRow::is_null(int column) const { return column_of(statement_, column).isNull(); }

std::int64_t SqliteRow::integer(int column) const {
  return column_of(statement_, column).getInt64();
}

double SqliteRow::real(int column) const {
  const SQLite::Column held = column_of(statement_, column);
  return held.isNull() ? std::numeric_limits<double>::quiet_NaN() : held.getDouble();
}

std::string SqliteRow::bytes(int column) const {
  const SQLite::Column held = column_of(statement_, column);
  const void* data = held.getBlob();
  return data == nullptr ? std::string()
                         : std::string(static_cast<const char*>(data),
                                       static_cast<std::size_t>(held.getBytes()));
}

bool SqliteRow::is_text(int column) const { return column_of(statement_, column).isText(); }

SqliteFile::SqliteFile(const fs::path& path) : path_(path) {
  require_readable_file(path);
  const std::string header = file_head(path, 100);
  if (header.empty()) throw Error("is empty: 0 bytes", {.file = path.string()});
  if (!header.starts_with(signature)) throw Error("is not an SQLite file", {.file = path.string()});
  if (header.size() < 100)
    throw Error("is an SQLite file with a truncated header", {.file = path.string()});
  std::uint64_t bytes = fs::file_size(path);
  std::error_code missing;
  const std::uintmax_t wal_bytes = fs::file_size(beside(path, "-wal"), missing);
  if (!missing) bytes += wal_bytes;
  try {
    connection_ = std::make_unique<Connection>(open_mode(path, header), bytes);
    connection_->database.execAndGet("SELECT count(*) FROM sqlite_master");
  } catch (const SQLite::Exception& error) {
    throw read_error(path, error);
  }
}

SqliteFile::~SqliteFile() = default;

void SqliteFile::each_row(const std::string& query, const std::vector<std::int64_t>& arguments,
                          const std::function<void(const SqliteRow&)>& use) const {
  const std::lock_guard lock(connection_->mutex);
  try {
    SQLite::Statement statement(connection_->database, query);
    for (std::size_t i = 0; i < arguments.size(); ++i)
      statement.bind(static_cast<int>(i) + 1, static_cast<std::int64_t>(arguments[i]));
    while (statement.executeStep()) use(SqliteRow(&statement));
  } catch (const SQLite::Exception& error) {
    throw read_error(path_, error);
  }
}

void SqliteFile::copy_to(const fs::path& target) const {
  const std::lock_guard lock(connection_->mutex);
  write_text(target, {});
  try {
    SQLite::Database copy(target.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    // An incomplete copy is useless, so no journal is needed for rolling back.
    copy.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;");
    if (SQLite::Backup(copy, connection_->database).executeStep() != SQLITE_DONE)
      throw Error("another program is writing to the file; try again when it has ended",
                  {.file = path_.string()}, ErrorKind::failed);
    // The copy of a file in WAL mode would require its own -wal.
    copy.exec("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = DELETE;");
  } catch (const SQLite::Exception& error) {
    throw copy_error(path_, target, error);
  }
}

std::set<std::string> SqliteFile::tables() const {
  std::set<std::string> names;
  each_row("SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'", {},
           [&](const SqliteRow& row) { names.insert(row.bytes(0)); });
  return names;
}

std::set<std::string> SqliteFile::columns(const std::string& table) const {
  std::set<std::string> names;
  std::string quoted;
  for (const char c : table) quoted += c == '"' ? "\"\"" : std::string(1, c);
  each_row("PRAGMA table_info(\"" + quoted + "\")", {},
           [&](const SqliteRow& row) { names.insert(row.bytes(1)); });
  return names;
}

bool is_sqlite_file(const fs::path& path) { return file_head(path, signature.size()) == signature; }

Error copy_error(const fs::path& source, const fs::path& target, const SQLite::Exception& error) {
  if (error.getErrorCode() == SQLITE_CORRUPT) return read_error(source, error);
  return Error(std::string("cannot be written: ") + error.what(), {.file = target.string()},
               ErrorKind::failed);
}

}  // namespace libmap
