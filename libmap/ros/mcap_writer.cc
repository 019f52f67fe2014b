// Writes MCAP with the profile ros2: chunks of messages, then the index by which readers seek.
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>

#include "libmap/core/error.h"
#include "libmap/ros/bag_storage.h"
#include "libmap/ros/chunk_compression.h"
#include "libmap/ros/mcap_records.h"
#include "libmap/ros/rosbag2_metadata.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;
using mcap::Opcode;
using mcap::Record;

constexpr std::size_t chunk_bytes = std::size_t{4} << 20;

std::string compression_name(BagCompression compression) {
  if (compression == BagCompression::bz2)
    throw Error("is not of MCAP",
                {.field = "compression", .value = "bz2", .bound = "none, lz4 or zstd"});
  return compression == BagCompression::lz4    ? "lz4"
         : compression == BagCompression::zstd ? "zstd"
                                               : "";
}

class McapSink : public BagSink {
 public:
  McapSink(const fs::path& path, BagCompression compression)
      : path_(path), compression_(compression_name(compression)), file_(path, std::ios::binary) {
    put(mcap::magic);
    put(Record().text("ros2").text("graspmap").as(Opcode::header));
  }

  void write(const StoredMessage& message) override {
    const std::uint16_t channel = channel_of(message);
    const auto stamp = static_cast<std::uint64_t>(message.stamp_ns);
    entries_[channel].number(stamp).number(static_cast<std::uint64_t>(chunk_.size()));
    chunk_ += Record()
                  .number(channel)
                  .number(std::uint32_t{0})
                  .number(stamp)
                  .number(stamp)
                  .bytes(message.bytes)
                  .as(Opcode::message);
    first_ns_ = std::min(first_ns_, stamp);
    last_ns_ = std::max(last_ns_, stamp);
    topics_.add(channel, 1, message.stamp_ns, message.stamp_ns);
    if (chunk_.size() >= chunk_bytes) put_chunk();
  }

  void close() override {
    if (!chunk_.empty()) put_chunk();
    put(Record().number(std::uint32_t{0}).as(Opcode::data_end));
    put_summary();
    put(mcap::magic);
    file_.close();
    require_written();
  }

 private:
  void require_written() const {
    if (!file_)
      throw Error(std::string("cannot be written: ") + std::strerror(errno),
                  {.file = path_.string()}, ErrorKind::failed);
  }

  void put(std::string_view bytes) {
    errno = 0;
    file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    require_written();
    position_ += bytes.size();
  }

  std::uint16_t channel_of(const StoredMessage& message) {
    const std::string type = ros2_name(message.type);
    const std::size_t before = topics_.topics.size();
    const std::size_t index = topics_.index_of({.name = message.topic,
                                                .type = type,
                                                .latching = message.latching,
                                                .encoding = MessageEncoding::cdr});
    const auto channel = static_cast<std::uint16_t>(index);
    if (index < before) return channel;
    const auto next = static_cast<std::uint16_t>(types_.size() + 1);
    const auto [known, is_new] = types_.emplace(type, next);
    if (is_new)
      add_definition(schemas_, Record()
                                   .number(next)
                                   .text(type)
                                   .text("ros2msg")
                                   .text(message.definition())
                                   .as(Opcode::schema));
    Record notes;
    notes.text("offered_qos_profiles").text(quality_of_service(message.latching));
    add_definition(channels_, Record()
                                  .number(channel)
                                  .number(known->second)
                                  .text(message.topic)
                                  .text("cdr")
                                  .text(notes.content())
                                  .as(Opcode::channel));
    return channel;
  }

  // Before the first message that needs it, and again in the summary.
  void add_definition(std::string& summary, const std::string& record) {
    summary += record;
    chunk_ += record;
  }

  void put_chunk() {
    const std::string records = compress_chunk(compression_, chunk_);
    const std::uint64_t begin = position_;
    put(Record()
            .number(first_ns_)
            .number(last_ns_)
            .number(static_cast<std::uint64_t>(chunk_.size()))
            .number(static_cast<std::uint32_t>(
                crc32_z(0, reinterpret_cast<const Bytef*>(chunk_.data()), chunk_.size())))
            .text(compression_)
            .text<std::uint64_t>(records)
            .as(Opcode::chunk));
    const std::uint64_t length = position_ - begin;
    Record offsets;
    for (const auto& [channel, entries] : entries_) {
      offsets.number(channel).number(position_);
      put(Record().number(channel).text(entries.content()).as(Opcode::message_index));
    }
    chunk_index_ += Record()
                        .number(first_ns_)
                        .number(last_ns_)
                        .number(begin)
                        .number(length)
                        .text(offsets.content())
                        .number(position_ - begin - length)
                        .text(compression_)
                        .number(static_cast<std::uint64_t>(records.size()))
                        .number(static_cast<std::uint64_t>(chunk_.size()))
                        .as(Opcode::chunk_index);
    ++chunks_;
    chunk_.clear();
    entries_.clear();
    first_ns_ = std::numeric_limits<std::uint64_t>::max();
    last_ns_ = 0;
  }

  std::string statistics() const {
    std::uint64_t messages = 0;
    Record counts;
    for (std::size_t n = 0; n < topics_.topics.size(); ++n) {
      messages += topics_.topics[n].messages;
      counts.number(static_cast<std::uint16_t>(n))
          .number(static_cast<std::uint64_t>(topics_.topics[n].messages));
    }
    const bool none = messages == 0;
    return Record()
        .number(messages)
        .number(static_cast<std::uint16_t>(types_.size()))
        .number(static_cast<std::uint32_t>(topics_.topics.size()))
        .number(std::uint32_t{0})  // attachments
        .number(std::uint32_t{0})  // metadata
        .number(chunks_)
        .number(none ? std::uint64_t{0} : static_cast<std::uint64_t>(topics_.first_ns))
        .number(none ? std::uint64_t{0} : static_cast<std::uint64_t>(topics_.last_ns))
        .text(counts.content())
        .as(Opcode::statistics);
  }

  void put_summary() {
    const std::uint64_t begin = position_;
    std::string offsets;
    const std::pair<Opcode, std::string> groups[] = {{Opcode::schema, schemas_},
                                                     {Opcode::channel, channels_},
                                                     {Opcode::statistics, statistics()},
                                                     {Opcode::chunk_index, chunk_index_}};
    for (const auto& [opcode, records] : groups) {
      if (records.empty()) continue;
      offsets += Record()
                     .number(opcode)
                     .number(position_)
                     .number(static_cast<std::uint64_t>(records.size()))
                     .as(Opcode::summary_offset);
      put(records);
    }
    const std::uint64_t offsets_begin = position_;
    put(offsets);
    // 0: no checksum of the summary.
    put(Record().number(begin).number(offsets_begin).number(std::uint32_t{0}).as(Opcode::footer));
  }

  fs::path path_;
  std::string compression_;
  std::ofstream file_;
  std::uint64_t position_ = 0;

  std::string chunk_;
  std::map<std::uint16_t, Record> entries_;  // of the chunk's messages, by channel
  std::uint64_t first_ns_ = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last_ns_ = 0;

  RecordedTopics topics_;
  std::map<std::string, std::uint16_t> types_;
  std::string schemas_;
  std::string channels_;
  std::string chunk_index_;
  std::uint32_t chunks_ = 0;
};

}  // namespace

std::unique_ptr<BagSink> new_mcap(const fs::path& path, BagCompression compression) {
  return std::make_unique<McapSink>(path, compression);
}

}  // namespace libmap
