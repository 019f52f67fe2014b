// Read-only access to SQLite files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace SQLite {
class Exception;
}

namespace libmap {

class Error;

// One row of a query; columns are numbered from 0.
class SqliteRow {
 public:
  explicit SqliteRow(const void* statement) : statement_(statement) {}

  bool is_null(int column) const;          // true for NULL
  std::int64_t integer(int column) const;  // 0 for NULL
  double real(int column) const;           // NaN for NULL
  std::string bytes(int column) const;     // bytes of a blob or a text; empty for NULL
  bool is_text(int column) const;          // false for numbers, blobs and NULL

 private:
  const void* statement_;
};

// Opens a file read-only and creates no files next to it (-journal, -wal, -shm).
//   - In rollback mode, it is read with SQLite's locks, after waiting up to 10 s for a writer. A
//     journal of an interrupted write is an Error, because rolling it back needs write access.
//   - In WAL mode, -wal and -shm are also read, so that data committed by another program are
//     visible. If only a -wal exists (after a crash), its index is kept in memory. If neither
//     exists, no program has the file open, and it is read as an unchanging file.
class SqliteFile {
 public:
  // Throws Error if the file is not an SQLite file, damaged or not readable.
  explicit SqliteFile(const std::filesystem::path& path);
  ~SqliteFile();
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

  // Calls `use` for each row of a query, in which `arguments` replace '?' in order. Thread-safe;
  // one query runs at a time. Throws Error naming the file.
  void each_row(const std::string& query, const std::vector<std::int64_t>& arguments,
                const std::function<void(const SqliteRow&)>& use) const;

  // Copies a consistent state of the file to `target`, replacing it. The copy is in rollback mode.
  // Throws Error if another program keeps writing, or the disk is full.
  void copy_to(const std::filesystem::path& target) const;

  // Return the names of all tables, and of a table's columns (empty if there is no such table).
  std::set<std::string> tables() const;
  std::set<std::string> columns(const std::string& table) const;

 private:
  struct Connection;
  std::filesystem::path path_;
  std::unique_ptr<Connection> connection_;
};

// True if the file begins with SQLite's signature.
bool is_sqlite_file(const std::filesystem::path& path);

// Returns the Error for an exception while `source` was copied or the copy was changed: bad input
// naming `source` if SQLite reports corruption, else a failed write of `target`.
Error copy_error(const std::filesystem::path& source, const std::filesystem::path& target,
                 const SQLite::Exception& error);

}  // namespace libmap
