// MCAP (https://mcap.dev/spec) consists of records: an opcode, the length of the content as uint64,
// the content; little-endian.
//
// The reader reads the records in the order of the file and ignores the index, which can be wrong.
// The writer uses the profile ros2: chunks of messages, then the index for seeking.
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <map>
#include <memory>
#include <utility>

#include "libmap/bag/bag_storage.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/bytes.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/output_lock.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;
using ros_message::printable;

constexpr std::string_view magic("\x89MCAP0\r\n", 8);

// Types of records that are read or written.
enum class Opcode : std::uint8_t {
  header = 1,
  footer,
  schema,
  channel,
  message,
  chunk,
  message_index,
  chunk_index,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F
};

// Returns a record: opcode, length of the content, content.
std::string as_record(Opcode opcode, const ByteWriter& content) {
  return ByteWriter().number(opcode).text<std::uint64_t>(content.content()).content();
}

constexpr std::uint64_t max_chunk_bytes = std::uint64_t{1} << 30;

Error broken_chunk(const std::string& compression) {
  return Error("is damaged", {.field = compression + " chunk"});
}

// Calls step(input, input size, output, output size), which sets both sizes to the bytes consumed
// and produced, until it returns false.
template <typename Step>
std::string expand(const std::string& compression, std::string_view bytes, std::uint64_t size,
                   const Step& step) {
  std::string result;
  auto piece = std::make_unique<std::array<char, 1U << 17U>>();
  bool more = true;
  while (more) {
    std::size_t used = bytes.size();
    std::size_t made = piece->size();
    more = step(bytes.data(), used, piece->data(), made);
    bytes.remove_prefix(used);
    if (made > size - result.size() || (more && used == 0 && made == 0))
      throw broken_chunk(compression);
    result.append(piece->data(), made);
  }
  return result;
}

std::string expand_lz4(std::string_view bytes, std::uint64_t size) {
  LZ4F_dctx* opened = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&opened, LZ4F_VERSION))) throw std::bad_alloc();
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      opened, LZ4F_freeDecompressionContext);
  return expand("lz4", bytes, size,
                [&](const char* input, std::size_t& used, char* output, std::size_t& made) {
                  const std::size_t left =
                      LZ4F_decompress(context.get(), output, &made, input, &used, nullptr);
                  if (LZ4F_isError(left)) throw broken_chunk("lz4");
                  return left != 0;
                });
}

std::string expand_zstd(std::string_view bytes, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                     ZSTD_freeDCtx);
  return expand("zstd", bytes, size,
                [&](const char* input, std::size_t& used, char* output, std::size_t& made) {
                  ZSTD_inBuffer in = {input, used, 0};
                  ZSTD_outBuffer out = {output, made, 0};
                  const std::size_t left = ZSTD_decompressStream(context.get(), &out, &in);
                  if (ZSTD_isError(left)) throw broken_chunk("zstd");
                  used = in.pos;
                  made = out.pos;
                  return left != 0;
                });
}

MessageEncoding encoding_named(std::string_view name) {
  return name == "cdr"    ? MessageEncoding::cdr
         : name == "ros1" ? MessageEncoding::ros1
                          : MessageEncoding::other;
}

class McapReader {
 public:
  // Receives the topic's index, the stamp and the bytes of each message.
  using Take = std::function<void(std::size_t, std::int64_t, std::string_view)>;

  McapReader(const fs::path& path, RecordedTopics& topics, Take take)
      : path_(path), topics_(topics), take_(std::move(take)), file_(path, std::ios::binary) {
    require_readable_file(path);
    left_ = fs::file_size(path);
    file_.seekg(-static_cast<std::streamoff>(magic.size()), std::ios::end);
    if (read_bytes(magic.size()) != magic)
      throw Error("is truncated: the recording was not ended; use `mcap recover`",
                  {.file = path_.string()});
    file_.seekg(static_cast<std::streamoff>(magic.size()));
    left_ -= std::min<std::uint64_t>(left_, magic.size());
  }

  void read_all() {
    try {
      while (read_record(static_cast<Opcode>(read_bytes(1).front()))) {
      }
    } catch (const std::length_error&) {
      throw Error("is damaged: a record is truncated", {.file = path_.string()});
    } catch (const Error& error) {
      throw error.in_file(path_.string());
    }
  }

 private:
  const std::string& read_bytes(std::uint64_t count) {
    if (count > left_) throw std::length_error("a record is truncated");
    left_ -= count;
    buffer_.resize(count);
    file_.read(buffer_.data(), static_cast<std::streamsize>(count));
    if (!file_) throw Error("cannot be read", {.file = path_.string()}, ErrorKind::failed);
    return buffer_;
  }

  // Reads a record. Returns false after the last message; the rest is the index.
  bool read_record(Opcode opcode) {
    const auto length = ByteReader(read_bytes(8)).number<std::uint64_t>();
    const std::string_view content = read_bytes(length);
    if (opcode == Opcode::data_end || opcode == Opcode::footer) return false;
    if (opcode == Opcode::chunk)
      take_chunk(ByteReader(content));
    else
      take_record(opcode, ByteReader(content));
    return true;
  }

  void take_chunk(ByteReader chunk) {
    chunk.take(16);  // the first and the last stamp
    const auto size = chunk.number<std::uint64_t>();
    const auto checksum = chunk.number<std::uint32_t>();
    const std::string compression = printable(std::string(chunk.text()));
    const std::string records = decompress_chunk(compression, chunk.text<std::uint64_t>(), size);
    // 0: not calculated.
    if (checksum != 0 &&
        checksum != crc32_z(0, reinterpret_cast<const Bytef*>(records.data()), records.size()))
      throw Error("does not match the checksum", {.field = "chunk"});
    ByteReader rest(records);
    while (!rest.empty()) {
      const auto opcode = rest.number<Opcode>();
      take_record(opcode, ByteReader(rest.text<std::uint64_t>()));
    }
  }

  void take_record(Opcode opcode, ByteReader record) {
    if (opcode == Opcode::schema) {
      const auto id = record.number<std::uint16_t>();
      types_[id] = printable(std::string(record.text()));
    } else if (opcode == Opcode::channel) {
      take_channel(record);
    } else if (opcode == Opcode::message) {
      const auto id = record.number<std::uint16_t>();
      const auto channel = channels_.find(id);
      if (channel == channels_.end())
        throw Error("the file does not declare this channel",
                    {.field = "channel of a message", .value = std::to_string(id)});
      record.take(4);  // sequence number
      const auto stamp = static_cast<std::int64_t>(record.number<std::uint64_t>());
      record.take(8);  // time of publishing
      take_(channel->second, stamp, record.rest());
    }
  }

  void take_channel(ByteReader record) {
    const auto id = record.number<std::uint16_t>();
    const auto type = types_.find(record.number<std::uint16_t>());
    BagTopic topic;
    if (type != types_.end()) topic.type = type->second;
    topic.name = printable(std::string(record.text()));
    topic.encoding = encoding_named(record.text());
    ByteReader notes(record.text());
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
  RecordedTopics& topics_;
  Take take_;
  std::ifstream file_;
  std::uint64_t left_ = 0;
  std::string buffer_;
  std::map<std::uint16_t, std::string> types_;
  std::map<std::uint16_t, std::size_t> channels_;
};

void list_mcap(const fs::path& path, RecordedTopics& recorded) {
  McapReader(path, recorded, [&](std::size_t topic, std::int64_t stamp, std::string_view) {
    recorded.add(topic, 1, stamp, stamp);
  }).read_all();
}

void read_mcap(const fs::path& path, const std::vector<BagRequest>& requests,
               const TakeMessage& take) {
  RecordedTopics recorded;
  McapReader(path, recorded, [&](std::size_t index, std::int64_t stamp, std::string_view bytes) {
    const BagTopic& topic = recorded.topics[index];
    for (const BagRequest& request : requests)
      if (request.topic == topic.name)
        return take({topic, stamp, bytes.substr(0, request.max_bytes)});
  }).read_all();
}

}  // namespace

const BagStorage mcap_storage = {"bag of ROS 2 (mcap)", list_mcap, read_mcap};

namespace {

constexpr std::size_t chunk_bytes = std::size_t{4} << 20;

std::string compression_name(BagCompression compression) {
  if (compression == BagCompression::bz2)
    throw Error("not supported by MCAP",
                {.field = "compression", .value = "bz2", .bound = "none, lz4 or zstd"});
  return compression == BagCompression::lz4    ? "lz4"
         : compression == BagCompression::zstd ? "zstd"
                                               : "";
}

class McapSink : public BagSink {
 public:
  McapSink(const fs::path& path, BagCompression compression)
      : path_(path), compression_(compression_name(compression)), file_(path, std::ios::binary) {
    put(magic);
    put(as_record(Opcode::header, ByteWriter().text("ros2").text("graspmap")));
  }

  void write(const StoredMessage& message) override {
    const std::uint16_t channel = channel_of(message);
    const auto stamp = static_cast<std::uint64_t>(message.stamp_ns);
    entries_[channel].number(stamp).number(static_cast<std::uint64_t>(chunk_.size()));
    chunk_ += as_record(Opcode::message, ByteWriter()
                                             .number(channel)
                                             .number(std::uint32_t{0})
                                             .number(stamp)
                                             .number(stamp)
                                             .bytes(message.bytes));
    first_ns_ = std::min(first_ns_, stamp);
    last_ns_ = std::max(last_ns_, stamp);
    topics_.add(channel, 1, message.stamp_ns, message.stamp_ns);
    if (chunk_.size() >= chunk_bytes) put_chunk();
  }

  void close() override {
    if (!chunk_.empty()) put_chunk();
    put(as_record(Opcode::data_end, ByteWriter().number(std::uint32_t{0})));
    put_summary();
    put(magic);
    file_.close();
    require_written();
  }

 private:
  void require_written() const {
    if (!file_) throw system_failure(path_, "cannot be written", errno);
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
      add_definition(schemas_, as_record(Opcode::schema,
                                         ByteWriter().number(next).text(type).text("ros2msg").text(
                                             message.definition())));
    ByteWriter notes;
    notes.text("offered_qos_profiles").text(quality_of_service(message.latching));
    add_definition(channels_, as_record(Opcode::channel, ByteWriter()
                                                             .number(channel)
                                                             .number(known->second)
                                                             .text(message.topic)
                                                             .text("cdr")
                                                             .text(notes.content())));
    return channel;
  }

  // Writes a definition before the first message that needs it, and again in the summary.
  void add_definition(std::string& summary, const std::string& record) {
    summary += record;
    chunk_ += record;
  }

  void put_chunk() {
    const std::string records = compress_chunk(compression_, chunk_);
    const std::uint64_t begin = position_;
    put(as_record(Opcode::chunk,
                  ByteWriter()
                      .number(first_ns_)
                      .number(last_ns_)
                      .number(static_cast<std::uint64_t>(chunk_.size()))
                      .number(static_cast<std::uint32_t>(
                          crc32_z(0, reinterpret_cast<const Bytef*>(chunk_.data()), chunk_.size())))
                      .text(compression_)
                      .text<std::uint64_t>(records)));
    const std::uint64_t length = position_ - begin;
    ByteWriter offsets;
    for (const auto& [channel, entries] : entries_) {
      offsets.number(channel).number(position_);
      put(as_record(Opcode::message_index, ByteWriter().number(channel).text(entries.content())));
    }
    chunk_index_ +=
        as_record(Opcode::chunk_index, ByteWriter()
                                           .number(first_ns_)
                                           .number(last_ns_)
                                           .number(begin)
                                           .number(length)
                                           .text(offsets.content())
                                           .number(position_ - begin - length)
                                           .text(compression_)
                                           .number(static_cast<std::uint64_t>(records.size()))
                                           .number(static_cast<std::uint64_t>(chunk_.size())));
    ++chunks_;
    chunk_.clear();
    entries_.clear();
    first_ns_ = std::numeric_limits<std::uint64_t>::max();
    last_ns_ = 0;
  }

  std::string statistics() const {
    std::uint64_t messages = 0;
    ByteWriter counts;
    for (std::size_t n = 0; n < topics_.topics.size(); ++n) {
      messages += topics_.topics[n].messages;
      counts.number(static_cast<std::uint16_t>(n))
          .number(static_cast<std::uint64_t>(topics_.topics[n].messages));
    }
    const bool none = messages == 0;
    return as_record(
        Opcode::statistics,
        ByteWriter()
            .number(messages)
            .number(static_cast<std::uint16_t>(types_.size()))
            .number(static_cast<std::uint32_t>(topics_.topics.size()))
            .number(std::uint32_t{0})  // attachments
            .number(std::uint32_t{0})  // metadata
            .number(chunks_)
            .number(none ? std::uint64_t{0} : static_cast<std::uint64_t>(topics_.first_ns))
            .number(none ? std::uint64_t{0} : static_cast<std::uint64_t>(topics_.last_ns))
            .text(counts.content()));
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
      offsets +=
          as_record(Opcode::summary_offset, ByteWriter().number(opcode).number(position_).number(
                                                static_cast<std::uint64_t>(records.size())));
      put(records);
    }
    const std::uint64_t offsets_begin = position_;
    put(offsets);
    // Checksum 0: the summary has none.
    put(as_record(Opcode::footer,
                  ByteWriter().number(begin).number(offsets_begin).number(std::uint32_t{0})));
  }

  fs::path path_;
  std::string compression_;
  std::ofstream file_;
  std::uint64_t position_ = 0;

  std::string chunk_;
  std::map<std::uint16_t, ByteWriter> entries_;  // index entries of the chunk, by channel
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

std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size) {
  if (size > max_chunk_bytes)
    throw Error("too large",
                {.field = "size of a chunk", .value = std::to_string(size), .bound = "<= 1 GiB"});
  std::string result;
  if (compression == "lz4")
    result = expand_lz4(bytes, size);
  else if (compression == "zstd")
    result = expand_zstd(bytes, size);
  else if (compression.empty())
    result = bytes;
  else
    throw Error(
        "not supported",
        {.field = "compression of a chunk", .value = compression, .bound = "lz4, zstd or none"});
  if (result.size() != size)
    throw Error("wrong size", {.field = "decompressed chunk",
                               .value = std::to_string(result.size()) + " bytes",
                               .bound = std::to_string(size) + " bytes"});
  return result;
}

std::string compress_chunk(const std::string& compression, const std::string& bytes) {
  if (compression.empty()) return bytes;
  const bool zstd = compression == "zstd";
  std::string result(
      zstd ? ZSTD_compressBound(bytes.size()) : LZ4F_compressFrameBound(bytes.size(), nullptr),
      '\0');
  const std::size_t size =
      zstd ? ZSTD_compress(result.data(), result.size(), bytes.data(), bytes.size(), 3)
           : LZ4F_compressFrame(result.data(), result.size(), bytes.data(), bytes.size(), nullptr);
  if (zstd ? ZSTD_isError(size) : LZ4F_isError(size))
    throw Error("a chunk cannot be compressed", {}, ErrorKind::failed);
  result.resize(size);
  return result;
}

}  // namespace libmap
