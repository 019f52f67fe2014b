// An SQLite file that is read and never changed.
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

// One row of a query; columns count from 0.
class SqliteRow {
 public:
  explicit SqliteRow(const void* statement) : statement_(statement) {}

  bool is_null(int column) const;          // of the row's column, counted from 0
  std::int64_t integer(int column) const;  // 0 where NULL
  double real(int column) const;           // NaN where NULL
  std::string bytes(int column) const;     // of a blob or a text
  bool is_text(int column) const;          // neither number, blob nor NULL

 private:
  const void* statement_;
};

// Opened read-only, and so that nothing appears beside the file: no journal, no -wal, no -shm.
//   - A file in rollback mode is read under SQLite's locks; it waits up to 10 s for a writer.
//   - A file in WAL mode whose -wal and -shm lie beside it is read with them, so what another
//     program has committed is seen.
//   - With a -wal alone (its program died) the -wal is read, into memory.
//   - With neither, nobody has it open, and it is read as a file that does not change.
// A journal that an interrupted write left behind is an Error: only a program that may write can
// roll it back.
class SqliteFile {
 public:
  // Throws Error: no SQLite file, broken or not readable.
  explicit SqliteFile(const std::filesystem::path& path);
  ~SqliteFile();
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

  // Calls `use` for each row, with the arguments in place of the query's '?'. One query runs at a
  // time, whatever the thread. Throws Error naming the file.
  void each_row(const std::string& query, const std::vector<std::int64_t>& arguments,
                const std::function<void(const SqliteRow&)>& use) const;

  // Every page, of one state of the file, to `target`: what stood there is lost. The copy is in
  // rollback mode. Throws Error: another program keeps writing, or the disk is full.
  void copy_to(const std::filesystem::path& target) const;

  // The names of all tables; of the columns of one, empty if it is not there.
  std::set<std::string> tables() const;
  std::set<std::string> columns(const std::string& table) const;

 private:
  struct Connection;
  std::filesystem::path path_;
  std::unique_ptr<Connection> connection_;
};

// Whether the file begins as every SQLite file does.
bool is_sqlite_file(const std::filesystem::path& path);

// Why a copy of `source` could not be made, or not be changed: what SQLite finds broken in it came
// from the source (bad input); all else is a failed write of `target`.
Error copy_error(const std::filesystem::path& source, const std::filesystem::path& target,
                 const SQLite::Exception& error);

}  // namespace libmap
