// ROS 1's storage, read and written by librosbag.
//
// librosbag does not check the offsets in a bag. It therefore reads in a child process with at most
// 3 GiB of memory and sends the content through a pipe. A bag on which it crashes is an Error.
#include <geometry_msgs/PoseArray.h>
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>
#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/bag/bag_storage.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/error.h"
#include "libmap/core/sandboxed_process.h"

namespace libmap {

// An encoded message for librosbag's templates.
struct EncodedMessage {
  const StoredMessage& message;
  std::string definition;
};

}  // namespace libmap

namespace ros {

namespace message_traits {

template <>
struct MD5Sum<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.message.type.md5sum;
  }
};
template <>
struct DataType<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.message.type.name;
  }
};
template <>
struct Definition<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.definition.c_str();
  }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<libmap::EncodedMessage> {
  template <typename Stream>
  static void write(Stream& stream, const libmap::EncodedMessage& encoded) {
    const std::string& bytes = encoded.message.bytes;
    std::copy(bytes.begin(), bytes.end(), stream.advance(static_cast<std::uint32_t>(bytes.size())));
  }
  static std::uint32_t serializedLength(const libmap::EncodedMessage& encoded) {
    return static_cast<std::uint32_t>(encoded.message.bytes.size());
  }
};

}  // namespace serialization

}  // namespace ros

namespace libmap {

namespace {

namespace fs = std::filesystem;
using ros_message::printable;

constexpr std::uint64_t max_data_bytes = std::uint64_t{3} << 30;

// Header of a text or message in the pipe.
struct Parcel {
  enum class Kind : std::uint32_t { topic, message, error, end };
  Kind kind = Kind::end;
  std::uint32_t topic = 0;     // index
  std::uint64_t size = 0;      // topic: number of messages
  std::int64_t stamp_ns = 0;   // stamp of the message; topic: of its first message
  std::int64_t last_ns = 0;    // topic: stamp of its last message
  std::uint32_t latching = 0;  // topic: 1 if latched
};

// Writing end of the pipe, in librosbag's process.
class Sender {
 public:
  explicit Sender(const SandboxedProcess::Write& write) : output_(write) {}

  void send(const Parcel& parcel, std::string_view bytes) {
    output_.value(parcel);
    output_.array(bytes);
  }
  void send_error(const std::string& text) { send({.kind = Parcel::Kind::error}, text); }

 private:
  SandboxWriter output_;
};

std::int64_t nanoseconds_of(const ros::Time& time) {
  return std::int64_t{time.sec} * 1'000'000'000 + time.nsec;
}

using Work = std::function<void(const rosbag::Bag&, Sender&)>;

void serve(const fs::path& path, const SandboxedProcess::Write& write, const Work& work) {
  Sender sender(write);
  // librosbag searches encryption plugins by rospack, which caches its results in this folder.
  setenv("ROS_HOME", "/dev/null", 1);
  try {
    rosbag::Bag bag;
    bag.open(path.string(), rosbag::bagmode::Read);
    work(bag, sender);
    sender.send({.kind = Parcel::Kind::end}, {});
  } catch (const rosbag::BagUnindexedException&) {
    sender.send_error("has no index: the recording was not ended; use `rosbag reindex`");
  } catch (const rosbag::BagException& error) {
    sender.send_error("is damaged or truncated: " + printable(error.what()));
  } catch (const std::bad_alloc&) {
    sender.send_error("is damaged or contains messages of more than 1 GiB");
  } catch (const std::exception& error) {
    // For example, exceptions of the loader of encryption plugins.
    sender.send_error("cannot be read: " + printable(error.what()));
  }
}

// Child process in which librosbag reads.
class GuardedBag {
 public:
  GuardedBag(const fs::path& path, const Work& work)
      : path_(path), process_(max_data_bytes, [&](const SandboxedProcess::Write& write) {
          serve(path, write, work);
        }) {}

  // Returns the next topic or message and its bytes; nullopt after the last.
  std::optional<Parcel> receive(std::string& bytes) {
    Parcel parcel;
    in_file(path_, [&] {
      input_.value(parcel);
      input_.array(bytes);
      if (parcel.kind == Parcel::Kind::error) throw Error(bytes);
    });
    if (parcel.kind == Parcel::Kind::end) return std::nullopt;
    return parcel;
  }

 private:
  fs::path path_;
  SandboxedProcess process_;
  SandboxReader input_{process_, "is broken: ROS's bag library crashed on it"};
};

// Topics of a view in the order of recording, and the topic of each connection, by its header.
struct Topics {
  std::vector<BagTopic> topics;
  std::map<const ros::M_string*, std::uint32_t> of_header;

  std::uint32_t of(const rosbag::MessageInstance& message) const {
    const auto found = of_header.find(message.getConnectionHeader().get());
    if (found == of_header.end())
      throw rosbag::BagFormatException("a message belongs to an unlisted connection");
    return found->second;
  }
};

std::string header_field(const rosbag::ConnectionInfo& connection, const std::string& name) {
  if (!connection.header) return {};
  const auto found = connection.header->find(name);
  return found == connection.header->end() ? std::string() : found->second;
}

Topics topics_of(rosbag::View& view) {
  std::vector<const rosbag::ConnectionInfo*> connections = view.getConnections();
  std::sort(connections.begin(), connections.end(),
            [](const auto* a, const auto* b) { return a->id < b->id; });
  RecordedTopics topics;
  Topics result;
  for (const rosbag::ConnectionInfo* connection : connections)
    result.of_header[connection->header.get()] = static_cast<std::uint32_t>(
        topics.index_of({connection->topic, connection->datatype, connection->md5sum,
                         header_field(*connection, "latching") == "1"}));
  result.topics = std::move(topics.topics);
  return result;
}

void send_topics(const Topics& topics, const std::vector<Parcel>& parcels, Sender& sender) {
  for (std::size_t n = 0; n < topics.topics.size(); ++n) {
    const BagTopic& topic = topics.topics[n];
    sender.send(parcels[n], printable(topic.name) + '\n' + printable(topic.type) + '\n' +
                                printable(topic.md5sum));
  }
}

std::vector<Parcel> parcels_of(const Topics& topics) {
  std::vector<Parcel> parcels(topics.topics.size());
  for (std::size_t n = 0; n < parcels.size(); ++n) {
    parcels[n].kind = Parcel::Kind::topic;
    parcels[n].topic = static_cast<std::uint32_t>(n);
    parcels[n].latching = topics.topics[n].latching ? 1 : 0;
  }
  return parcels;
}

void send_listing(const rosbag::Bag& bag, Sender& sender) {
  rosbag::View view(bag);
  const Topics topics = topics_of(view);
  std::vector<Parcel> parcels = parcels_of(topics);
  for (const rosbag::MessageInstance& message : view) {
    Parcel& parcel = parcels[topics.of(message)];
    const std::int64_t stamp = nanoseconds_of(message.getTime());
    if (parcel.size++ == 0) parcel.stamp_ns = parcel.last_ns = stamp;
    parcel.stamp_ns = std::min(parcel.stamp_ns, stamp);
    parcel.last_ns = std::max(parcel.last_ns, stamp);
  }
  send_topics(topics, parcels, sender);
}

void send_messages(const rosbag::Bag& bag, const std::vector<BagRequest>& requests,
                   Sender& sender) {
  std::vector<std::string> names;
  names.reserve(requests.size());
  for (const BagRequest& request : requests) names.push_back(request.topic);
  rosbag::View view(bag, rosbag::TopicQuery(names));
  const Topics topics = topics_of(view);
  send_topics(topics, parcels_of(topics), sender);
  std::vector<std::size_t> wanted;
  for (const BagTopic& topic : topics.topics)
    wanted.push_back(
        requests[static_cast<std::size_t>(std::find(names.begin(), names.end(), topic.name) -
                                          names.begin())]
            .max_bytes);
  std::string bytes;
  for (const rosbag::MessageInstance& message : view) {
    const std::uint32_t size = message.size();
    bytes.resize(size);
    ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()), size);
    message.write(stream);
    const std::uint32_t topic = topics.of(message);
    sender.send({.kind = Parcel::Kind::message,
                 .topic = topic,
                 .stamp_ns = nanoseconds_of(message.getTime())},
                std::string_view(bytes).substr(0, wanted[topic]));
  }
}

BagTopic topic_from(const Parcel& parcel, const std::string& text) {
  const std::size_t first = text.find('\n');
  const std::size_t second = text.find('\n', first + 1);
  return {text.substr(0, first), text.substr(first + 1, second - first - 1),
          text.substr(second + 1), parcel.latching != 0};
}

void list_ros1(const fs::path& path, RecordedTopics& topics) {
  GuardedBag bag(path, send_listing);
  std::string bytes;
  while (const std::optional<Parcel> parcel = bag.receive(bytes))
    topics.add(topics.index_of(topic_from(*parcel, bytes)), parcel->size, parcel->stamp_ns,
               parcel->last_ns);
}

void read_ros1(const fs::path& path, const std::vector<BagRequest>& requests,
               const TakeMessage& take) {
  GuardedBag bag(path, [&](const rosbag::Bag& opened, Sender& sender) {
    send_messages(opened, requests, sender);
  });
  std::vector<BagTopic> topics;
  std::string bytes;
  while (const std::optional<Parcel> parcel = bag.receive(bytes)) {
    if (parcel->kind == Parcel::Kind::topic)
      topics.push_back(topic_from(*parcel, bytes));
    else
      take({topics.at(parcel->topic), parcel->stamp_ns, bytes});
  }
}

}  // namespace

const BagStorage ros1_storage = {"bag of ROS 1", list_ros1, read_ros1};

namespace {

// Returns the type's definition in ROS 1 with the definitions of its parts.
std::string definition_of_type(const std::string& type) {
  using namespace ros::message_traits;
  static const std::map<std::string, std::string> definitions = {
      {"geometry_msgs/PoseArray", definition<geometry_msgs::PoseArray>()},
      {"sensor_msgs/CameraInfo", definition<sensor_msgs::CameraInfo>()},
      {"sensor_msgs/Image", definition<sensor_msgs::Image>()},
      {"sensor_msgs/PointCloud2", definition<sensor_msgs::PointCloud2>()},
      {"tf2_msgs/TFMessage", definition<tf2_msgs::TFMessage>()},
      {"visualization_msgs/MarkerArray", definition<visualization_msgs::MarkerArray>()}};
  const auto found = definitions.find(type);
  if (found == definitions.end())
    throw Error("not supported in bags of ROS 1", {.field = "message type", .value = type});
  return found->second;
}

rosbag::CompressionType to_rosbag(BagCompression compression) {
  switch (compression) {
    case BagCompression::none:
      return rosbag::compression::Uncompressed;
    case BagCompression::bz2:
      return rosbag::compression::BZ2;
    case BagCompression::lz4:
      return rosbag::compression::LZ4;
    case BagCompression::zstd:
      break;
  }
  throw Error("not supported by bags of ROS 1",
              {.field = "compression", .value = "zstd", .bound = "none, bz2 or lz4"});
}

// Redirects the cache of rospack, by which librosbag searches encryption plugins, to a temporary
// folder. rospack warns if it cannot write to its cache in the user's folder.
class PluginSearch {
 public:
  PluginSearch() {
    std::error_code code;
    std::string folder = (fs::temp_directory_path(code) / "graspmap-XXXXXX").string();
    if (code || mkdtemp(folder.data()) == nullptr) return;
    folder_ = folder;
    if (const char* const before = std::getenv(variable)) before_ = before;
    setenv(variable, folder.c_str(), 1);
  }
  ~PluginSearch() {
    if (folder_.empty()) return;
    if (before_)
      setenv(variable, before_->c_str(), 1);
    else
      unsetenv(variable);
    std::error_code code;
    fs::remove_all(folder_, code);
  }
  PluginSearch(const PluginSearch&) = delete;
  PluginSearch& operator=(const PluginSearch&) = delete;

 private:
  static constexpr const char* variable = "ROS_HOME";

  fs::path folder_;
  std::optional<std::string> before_;
};

std::unique_ptr<rosbag::Bag> new_bag() {
  const PluginSearch search;
  return std::make_unique<rosbag::Bag>();
}

// Converts librosbag's exceptions, which only writes cause, to Errors (failed) by errno.
template <typename Action>
void guarded(const fs::path& path, const Action& action) {
  errno = 0;
  try {
    action();
  } catch (const rosbag::BagException& error) {
    throw Error(
        std::string("cannot be written: ") + (errno == 0 ? error.what() : std::strerror(errno)),
        {.file = path.string()}, ErrorKind::failed);
  }
}

class Ros1Sink : public BagSink {
 public:
  // Delegates, so that the destructor is called if opening fails.
  Ros1Sink(const fs::path& path, BagCompression compression) : Ros1Sink(path) {
    const rosbag::CompressionType type = to_rosbag(compression);
    guarded(path_, [&] {
      bag_->open(path_.string(), rosbag::bagmode::Write);
      bag_->setCompression(type);
    });
  }
  // On a full disk, librosbag's destructor throws; the bag object is leaked instead.
  ~Ros1Sink() override {
    try {
      bag_->close();
    } catch (const std::exception&) {
      static auto* const kept = new std::vector<rosbag::Bag*>();
      kept->push_back(bag_.release());
    }
  }
  Ros1Sink(const Ros1Sink&) = delete;
  Ros1Sink& operator=(const Ros1Sink&) = delete;

  void write(const StoredMessage& message) override {
    const EncodedMessage encoded{message, definition_of_type(message.type.name)};
    const auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = message.topic;
    (*header)["type"] = message.type.name;
    (*header)["md5sum"] = message.type.md5sum;
    (*header)["message_definition"] = encoded.definition;
    (*header)["callerid"] = "/graspmap";
    (*header)["latching"] = message.latching ? "1" : "0";
    constexpr std::int64_t second = 1'000'000'000;
    const ros::Time time(static_cast<std::uint32_t>(message.stamp_ns / second),
                         static_cast<std::uint32_t>(message.stamp_ns % second));
    guarded(path_, [&] { bag_->write(message.topic, time, encoded, header); });
  }

  void close() override {
    guarded(path_, [&] { bag_->close(); });
  }

 private:
  explicit Ros1Sink(const fs::path& path) : path_(path) {}

  fs::path path_;
  std::unique_ptr<rosbag::Bag> bag_ = new_bag();
};

}  // namespace

std::unique_ptr<BagSink> new_ros1_bag(const fs::path& path, BagCompression compression) {
  return std::make_unique<Ros1Sink>(path, compression);
}

}  // namespace libmap
