// Reads MCAP record by record, in the order of the file: its index is not needed, and need not be
// believed.
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/ros/bag_storage.h"
#include "libmap/ros/chunk_compression.h"
#include "libmap/ros/mcap_records.h"
#include "libmap/ros/ros_messages.h"
#include "libmap/ros/rosbag2_metadata.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;
using mcap::Fields;
using mcap::Opcode;
using ros_message::printable;

MessageEncoding encoding_named(std::string_view name) {
  return name == "cdr"    ? MessageEncoding::cdr
         : name == "ros1" ? MessageEncoding::ros1
                          : MessageEncoding::other;
}

class McapReader {
 public:
  // Of each message: its topic's index, its stamp and its bytes.
  using Take = std::function<void(std::size_t, std::int64_t, std::string_view)>;

  McapReader(const fs::path& path, const Take& take)
      : path_(path), take_(take), file_(path, std::ios::binary) {
    require_readable_file(path);
    left_ = fs::file_size(path);
    file_.seekg(-static_cast<std::streamoff>(mcap::magic.size()), std::ios::end);
    if (read_bytes(mcap::magic.size()) != mcap::magic)
      throw Error("is cut off: its recording was not ended (`mcap recover` mends it)",
                  {.file = path_.string()});
    file_.seekg(static_cast<std::streamoff>(mcap::magic.size()));
    left_ -= std::min<std::uint64_t>(left_, mcap::magic.size());
  }

  void read_all() {
    try {
      while (read_record(static_cast<Opcode>(read_bytes(1).front()))) {
      }
    } catch (const std::length_error&) {
      throw Error("is broken: a record ends too early", {.file = path_.string()});
    } catch (const Error& error) {
      throw error.in_file(path_.string());
    }
  }

  RecordedTopics& topics() { return topics_; }

 private:
  const std::string& read_bytes(std::uint64_t count) {
    if (count > left_) throw std::length_error("a record ends too early");
    left_ -= count;
    buffer_.resize(count);
    file_.read(buffer_.data(), static_cast<std::streamsize>(count));
    if (!file_) throw Error("cannot be read", {.file = path_.string()}, ErrorKind::failed);
    return buffer_;
  }

  // False behind the last message: what follows is the index.
  bool read_record(Opcode opcode) {
    const auto length = Fields(read_bytes(8)).number<std::uint64_t>();
    const std::string_view content = read_bytes(length);
    if (opcode == Opcode::data_end || opcode == Opcode::footer) return false;
    if (opcode == Opcode::chunk)
      take_chunk(Fields(content));
    else
      take_record(opcode, Fields(content));
    return true;
  }

  void take_chunk(Fields chunk) {
    chunk.take(16);  // the first and the last stamp
    const auto size = chunk.number<std::uint64_t>();
    const auto checksum = chunk.number<std::uint32_t>();
    const std::string compression = printable(std::string(chunk.text()));
    const std::string records = decompress_chunk(compression, chunk.text<std::uint64_t>(), size);
    // 0: it was not calculated.
    if (checksum != 0 &&
        checksum != crc32_z(0, reinterpret_cast<const Bytef*>(records.data()), records.size()))
      throw Error("does not fit its checksum", {.field = "chunk"});
    Fields rest(records);
    while (!rest.empty()) {
      const auto opcode = rest.number<Opcode>();
      take_record(opcode, Fields(rest.text<std::uint64_t>()));
    }
  }

  void take_record(Opcode opcode, Fields record) {
    if (opcode == Opcode::schema) {
      const auto id = record.number<std::uint16_t>();
      types_[id] = printable(std::string(record.text()));
    } else if (opcode == Opcode::channel) {
      take_channel(record);
    } else if (opcode == Opcode::message) {
      const auto id = record.number<std::uint16_t>();
      const auto channel = channels_.find(id);
      if (channel == channels_.end())
        throw Error("was not said", {.field = "channel of a message", .value = std::to_string(id)});
      record.take(4);  // its number
      const auto stamp = static_cast<std::int64_t>(record.number<std::uint64_t>());
      record.take(8);  // when it was published
      take_(channel->second, stamp, record.rest());
    }
  }

  void take_channel(Fields record) {
    const auto id = record.number<std::uint16_t>();
    const auto type = types_.find(record.number<std::uint16_t>());
    BagTopic topic;
    if (type != types_.end()) topic.type = type->second;
    topic.name = printable(std::string(record.text()));
    topic.encoding = encoding_named(record.text());
    Fields notes(record.text());
    while (!notes.empty()) {
      const std::string_view key = notes.text();
      const std::string_view value = notes.text();
      if (key == "offered_qos_profiles") topic.latching = is_latching(value);
      if (key == "latching") topic.latching = value == "1";
      if (key == "md5sum") topic.md5sum = printable(std::string(value));
    }
    channels_[id] = topics_.index_of(topic);
  }

  fs::path path_;
  const Take& take_;
  std::ifstream file_;
  std::uint64_t left_ = 0;
  std::string buffer_;
  std::map<std::uint16_t, std::string> types_;
  std::map<std::uint16_t, std::size_t> channels_;
  RecordedTopics topics_;
};

void list_mcap(const fs::path& path, RecordedTopics& recorded) {
  RecordedTopics* found = nullptr;
  const McapReader::Take take = [&](std::size_t topic, std::int64_t stamp, std::string_view) {
    found->add(topic, 1, stamp, stamp);
  };
  McapReader reader(path, take);
  found = &reader.topics();
  reader.read_all();
  for (BagTopic topic : found->topics) {
    const std::size_t messages = std::exchange(topic.messages, 0);
    if (messages > 0)
      recorded.add(recorded.index_of(topic), messages, found->first_ns, found->last_ns);
  }
}

void read_mcap(const fs::path& path, const std::vector<BagRequest>& requests,
               const TakeMessage& take) {
  const std::vector<BagTopic>* topics = nullptr;
  const McapReader::Take take_wanted = [&](std::size_t index, std::int64_t stamp,
                                           std::string_view bytes) {
    const BagTopic& topic = (*topics)[index];
    for (const BagRequest& request : requests)
      if (request.topic == topic.name)
        return take({topic, stamp, bytes.substr(0, request.max_bytes)});
  };
  McapReader reader(path, take_wanted);
  topics = &reader.topics().topics;
  reader.read_all();
}

}  // namespace

const BagStorage mcap_storage = {"bag of ROS 2 (mcap)", list_mcap, read_mcap};

}  // namespace libmap
