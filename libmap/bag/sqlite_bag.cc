// rosbag2's storage sqlite3: topics and messages as tables of .db3 files
// (https://github.com/ros2/rosbag2, rosbag2_storage_sqlite3/src/rosbag2_storage_sqlite3/
// sqlite_storage.cpp; written as its schema 3, of Humble).
#include <SQLiteCpp/SQLiteCpp.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "libmap/bag/bag_storage.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

YAML::Node field_of(const YAML::Node& map, const char* name) {
  return map.IsMap() ? map[name] : YAML::Node(YAML::NodeType::Undefined);
}

std::string text_of(const YAML::Node& map, const char* name) {
  const YAML::Node node = field_of(map, name);
  return node && node.IsScalar() ? node.Scalar() : std::string();
}

// Returns the file name without the folder, which older versions prepend.
std::string name_of_file(const YAML::Node& node) {
  const std::string name =
      node.IsScalar() ? fs::path(node.Scalar()).filename().string() : std::string();
  if (name.empty() || name == "." || name == "..")
    throw at_node(Error("not a file name"), "relative_file_paths", node);
  return name;
}

std::string lines_of_topic(const BagTopic& topic) {
  std::string quality;
  for (const char c : quality_of_service(topic.latching))
    quality += c == '\n' ? std::string("\\n") : std::string(1, c);
  return "    - topic_metadata:\n        name: " + topic.name + "\n        type: " + topic.type +
         "\n        serialization_format: cdr\n        offered_qos_profiles: \"" + quality +
         "\"\n      message_count: " + std::to_string(topic.messages) + "\n";
}

std::string lines_of_times(const RecordedTopics& topics, const std::string& indent) {
  const std::int64_t duration = topics.last_ns - topics.first_ns;
  return indent + "duration:\n" + indent + "  nanoseconds: " + std::to_string(duration) + "\n" +
         indent + "starting_time:\n" + indent +
         "  nanoseconds_since_epoch: " + std::to_string(topics.first_ns) + "\n";
}

}  // namespace

std::vector<std::string> read_rosbag2_metadata(const fs::path& path) {
  if (!fs::exists(path))
    throw Error(
        "no such file: the folder is not a bag, or the recording was not ended (`ros2 bag reindex` "
        "repairs it)",
        {.file = path.string()});
  std::vector<std::string> names;
  read_yaml(read_whole_file(path, max_yaml_bytes), path.string(), [&](const YAML::Node& document) {
    const YAML::Node bag = field_of(document, "rosbag2_bagfile_information");
    if (!bag || !bag.IsMap()) throw Error("is missing", {.field = "rosbag2_bagfile_information"});
    const std::string format = text_of(bag, "compression_format");
    if (!format.empty())
      throw Error("compressed folders are not supported; decompress with `ros2 bag convert`",
                  {.field = "compression_format", .value = ros_message::printable(format)});
    const YAML::Node files = field_of(bag, "relative_file_paths");
    if (!files || !files.IsSequence() || files.size() == 0)
      throw Error("contains no file name", {.field = "relative_file_paths"});
    for (const YAML::Node& file : files) names.push_back(name_of_file(file));
  });
  return names;
}

std::string rosbag2_metadata(const RecordedTopics& topics, const std::string& storage,
                             const std::string& file) {
  std::size_t messages = 0;
  std::string lines;
  for (const BagTopic& topic : topics.topics) {
    messages += topic.messages;
    lines += lines_of_topic(topic);
  }
  const std::string count = std::to_string(messages);
  return "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: " + storage + "\n" +
         lines_of_times(topics, "  ") + "  message_count: " + count +
         "\n  topics_with_message_count:\n" + lines +
         "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " +
         file + "\n  files:\n    - path: " + file + "\n" + lines_of_times(topics, "      ") +
         "      message_count: " + count + "\n";
}

std::string quality_of_service(bool latching) {
  if (!latching) return {};
  const std::string forever = "\n    sec: 9223372036\n    nsec: 854775807\n";
  return "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:" + forever +
         "  lifespan:" + forever + "  liveliness: 1\n  liveliness_lease_duration:" + forever +
         "  avoid_ros_namespace_conventions: false";
}

bool is_latching(std::string_view quality_of_service) {
  return quality_of_service.find("durability: 1") != std::string_view::npos ||
         quality_of_service.find("durability: transient_local") != std::string_view::npos;
}

namespace {

namespace fs = std::filesystem;
using ros_message::printable;

constexpr const char* db3_name = "bag_0.db3";

void require_columns(const SqliteFile& file, const std::string& table,
                     const std::vector<std::string>& names) {
  if (!file.tables().contains(table))
    throw Error("does not exist; a bag of ROS 2 is required",
                {.file = file.path().string(), .field = "table " + table});
  const std::set<std::string> columns = file.columns(table);
  for (const std::string& name : names)
    if (!columns.contains(name))
      throw Error("does not exist; a bag of ROS 2 is required",
                  {.file = file.path().string(), .field = "column " + name + " of table " + table});
}

// Returns the topics by their id in the file.
std::map<std::int64_t, BagTopic> stored_topics(const SqliteFile& file) {
  // SQLite reads missing bytes of the last page as zeros.
  file.each_row("PRAGMA page_size", {}, [&](const SqliteRow& row) {
    if (fs::file_size(file.path()) % static_cast<std::uint64_t>(row.integer(0)) != 0)
      throw Error("is truncated: the size is not a multiple of the page size",
                  {.file = file.path().string()});
  });
  require_columns(file, "topics", {"id", "name", "type", "serialization_format"});
  require_columns(file, "messages", {"topic_id", "timestamp", "data"});
  // Dashing's bags do not have this column.
  const bool has_quality = file.columns("topics").contains("offered_qos_profiles");
  std::map<std::int64_t, BagTopic> topics;
  file.each_row("SELECT id, name, type, serialization_format, " +
                    std::string(has_quality ? "offered_qos_profiles" : "''") + " FROM topics",
                {}, [&](const SqliteRow& row) {
                  topics[row.integer(0)] = {.name = printable(row.bytes(1)),
                                            .type = printable(row.bytes(2)),
                                            .latching = is_latching(row.bytes(4)),
                                            .encoding = row.bytes(3) == "cdr"
                                                            ? MessageEncoding::cdr
                                                            : MessageEncoding::other};
                });
  return topics;
}

void list_sqlite(const fs::path& path, RecordedTopics& recorded) {
  const SqliteFile file(path);
  std::map<std::int64_t, std::size_t> index;
  for (const auto& [id, topic] : stored_topics(file)) index[id] = recorded.index_of(topic);
  file.each_row(
      "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id",
      {}, [&](const SqliteRow& row) {
        const auto found = index.find(row.integer(0));
        if (found == index.end())
          throw Error("not in the table topics", {.file = path.string(),
                                                  .field = "topic_id of a message",
                                                  .value = std::to_string(row.integer(0))});
        recorded.add(found->second, static_cast<std::size_t>(row.integer(1)), row.integer(2),
                     row.integer(3));
      });
}

struct StoredRow {
  std::int64_t stamp_ns = 0;
  std::int64_t id = 0;
  std::int64_t topic = 0;

  auto operator<=>(const StoredRow&) const = default;
};

void read_sqlite(const fs::path& path, const std::vector<BagRequest>& requests,
                 const TakeMessage& take) {
  const SqliteFile file(path);
  const std::map<std::int64_t, BagTopic> topics = stored_topics(file);
  std::map<std::int64_t, std::int64_t> max_bytes;  // by topic
  for (const auto& [id, topic] : topics)
    for (const BagRequest& request : requests)
      if (request.topic == topic.name)
        max_bytes[id] = static_cast<std::int64_t>(
            std::min<std::size_t>(request.max_bytes, std::numeric_limits<int>::max()));
  // Sorted here, because without an index of stamps SQLite would sort the rows with their data.
  std::vector<StoredRow> rows;
  file.each_row("SELECT timestamp, rowid, topic_id FROM messages", {}, [&](const SqliteRow& row) {
    if (max_bytes.contains(row.integer(2)))
      rows.push_back({row.integer(0), row.integer(1), row.integer(2)});
  });
  std::sort(rows.begin(), rows.end());
  for (const StoredRow& row : rows) {
    std::string bytes;
    file.each_row("SELECT substr(data, 1, ?) FROM messages WHERE rowid = ?",
                  {max_bytes.at(row.topic), row.id},
                  [&](const SqliteRow& data) { bytes = data.bytes(0); });
    take({topics.at(row.topic), row.stamp_ns, bytes});
  }
}

class SqliteSink : public BagSink {
 public:
  explicit SqliteSink(const fs::path& folder) : folder_(folder) {
    guarded([&] {
      database_.emplace((folder_ / db3_name).string(),
                        SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      // An incomplete file is useless, so no journal is needed for rolling back.
      database_->exec(
          "PRAGMA page_size = 4096; PRAGMA encoding = 'UTF-8'; PRAGMA locking_mode = EXCLUSIVE; "
          "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN EXCLUSIVE; "
          "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL); "
          "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, "
          "metadata TEXT NOT NULL); "
          "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
          "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL); "
          "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
          "timestamp INTEGER NOT NULL, data BLOB NOT NULL); "
          "CREATE INDEX timestamp_idx ON messages (timestamp ASC); "
          "INSERT INTO schema VALUES (3, 'humble');");
      insert_topic_.emplace(*database_, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', ?)");
      insert_message_.emplace(*database_,
                              "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
    });
  }

  void write(const StoredMessage& message) override {
    constexpr std::size_t max_bytes = 1'000'000'000;  // SQLite's limit
    if (message.bytes.size() > max_bytes)
      throw Error("too large for a .db3; use .mcap",
                  {.field = "size of a message on " + message.topic,
                   .value = std::to_string(message.bytes.size()) + " bytes",
                   .bound = "<= 10^9 bytes"});
    const BagTopic topic = {.name = message.topic,
                            .type = ros2_name(message.type),
                            .latching = message.latching,
                            .encoding = MessageEncoding::cdr};
    const std::size_t before = recorded_.topics.size();
    const std::size_t index = recorded_.index_of(topic);
    recorded_.add(index, 1, message.stamp_ns, message.stamp_ns);
    guarded([&] {
      const auto id = static_cast<std::int64_t>(index + 1);
      if (index == before) {
        insert_topic_->reset();
        insert_topic_->bind(1, id);
        insert_topic_->bind(2, topic.name);
        insert_topic_->bind(3, topic.type);
        insert_topic_->bind(4, quality_of_service(topic.latching));
        insert_topic_->exec();
      }
      insert_message_->reset();
      insert_message_->bind(1, id);
      insert_message_->bind(2, message.stamp_ns);
      insert_message_->bindNoCopy(3, message.bytes.data(), static_cast<int>(message.bytes.size()));
      insert_message_->exec();
    });
  }

  void close() override {
    guarded([&] {
      insert_topic_.reset();
      insert_message_.reset();
      database_->exec("COMMIT");
      database_.reset();
    });
    write_text(folder_ / rosbag2_metadata_name, rosbag2_metadata(recorded_, "sqlite3", db3_name));
  }

 private:
  template <typename Action>
  void guarded(const Action& action) {
    try {
      action();
    } catch (const SQLite::Exception& error) {
      throw Error(std::string("cannot be written: ") + error.what(),
                  {.file = (folder_ / db3_name).string()}, ErrorKind::failed);
    }
  }

  fs::path folder_;
  std::optional<SQLite::Database> database_;
  std::optional<SQLite::Statement> insert_topic_;
  std::optional<SQLite::Statement> insert_message_;
  RecordedTopics recorded_;
};

}  // namespace

const BagStorage sqlite_storage = {"bag of ROS 2 (sqlite3)", list_sqlite, read_sqlite};

std::vector<std::string> names_in_bag_folder() { return {rosbag2_metadata_name, db3_name}; }

std::unique_ptr<BagSink> new_sqlite_bag(const fs::path& folder) {
  return std::make_unique<SqliteSink>(folder);
}

}  // namespace libmap
