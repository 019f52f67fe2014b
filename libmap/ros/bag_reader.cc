#include "libmap/ros/bag_reader.h"

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <optional>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/guarded_process.h"
#include "libmap/core/text.h"
#include "libmap/ros/ros_messages.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;
using ros_message::printable;

constexpr std::uint64_t max_data_bytes = std::uint64_t{3} << 30;

// What comes through the pipe: one head, then `bytes` of text or message.
struct Parcel {
  enum class Kind : std::uint32_t { topic, message, error, end };
  Kind kind = Kind::end;
  std::uint32_t topic = 0;     // index
  std::uint64_t bytes = 0;     // that follow
  std::uint64_t size = 0;      // of a topic: how many messages
  std::int64_t stamp_ns = 0;   // of a message; of a topic: of its first one
  std::int64_t last_ns = 0;    // of a topic's last message
  std::uint32_t latching = 0;  // of a topic
};

// The end of the pipe at which librosbag works.
class Sender {
 public:
  explicit Sender(const GuardedProcess::Write& write) : write_(write) {}

  void send(Parcel parcel, std::string_view bytes) {
    parcel.bytes = bytes.size();
    write_({reinterpret_cast<const char*>(&parcel), sizeof parcel});
    write_(bytes);
  }
  void send_error(const std::string& text) { send({.kind = Parcel::Kind::error}, text); }

 private:
  const GuardedProcess::Write& write_;
};

using Work = std::function<void(const rosbag::Bag&, Sender&)>;

void serve(const fs::path& path, const GuardedProcess::Write& write, const Work& work) {
  Sender sender(write);
  // librosbag looks for plugins of encryption by rospack, which keeps what it finds in this folder.
  setenv("ROS_HOME", "/dev/null", 1);
  try {
    rosbag::Bag bag;
    bag.open(path.string(), rosbag::bagmode::Read);
    work(bag, sender);
    sender.send({.kind = Parcel::Kind::end}, {});
  } catch (const rosbag::BagUnindexedException&) {
    sender.send_error("has no index: its recording was not ended (`rosbag reindex` makes one)");
  } catch (const rosbag::BagException& error) {
    sender.send_error("is broken or cut off: " + printable(std::string(error.what())));
  } catch (const std::bad_alloc&) {
    sender.send_error("is broken, or contains messages of more than 1 GiB");
  } catch (const std::exception& error) {
    // The loader of encryption plugins, for one.
    sender.send_error("cannot be read: " + printable(std::string(error.what())));
  }
}

// The process in which librosbag reads.
class GuardedBag {
 public:
  GuardedBag(const fs::path& path, const Work& work)
      : path_(path), process_(max_data_bytes, [&](const GuardedProcess::Write& write) {
          serve(path, write, work);
        }) {}

  // The next topic or message and its bytes; nothing after the last.
  std::optional<Parcel> receive(std::string& bytes) {
    Parcel parcel;
    if (!process_.read(&parcel, sizeof parcel)) throw_fallen();
    bytes.resize(parcel.bytes);
    if (!process_.read(bytes.data(), bytes.size())) throw_fallen();
    if (parcel.kind == Parcel::Kind::error) throw Error(bytes, {.file = path_.string()});
    if (parcel.kind == Parcel::Kind::end) return std::nullopt;
    return parcel;
  }

 private:
  [[noreturn]] void throw_fallen() {
    throw Error("is broken: ROS's bag library crashed on it" + process_.end(),
                {.file = path_.string()});
  }

  fs::path path_;
  GuardedProcess process_;
};

void require_bag(const fs::path& path) {
  require_readable_file(path);
  std::string head(16, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  if (head.starts_with("#ROSBAG V2.0\n") || head.starts_with("#ROSBAG V1.")) return;
  const bool ros2 = head.starts_with("SQLite format 3") || head.starts_with("\x89MCAP");
  throw Error(ros2 ? "is a bag of ROS 2, of which only ROS 1's are read" : "is no ROS 1 bag",
              {.file = path.string(),
               .field = "first line",
               .value = printable(head.substr(0, head.find('\n'))),
               .bound = "#ROSBAG V2.0 or V1.x"});
}

// The topics of a view, in the order of recording, and the one of each connection, by its header.
struct Topics {
  std::vector<BagTopic> topics;
  std::map<const ros::M_string*, std::uint32_t> of_header;

  std::uint32_t of(const rosbag::MessageInstance& message) const {
    const auto found = of_header.find(message.getConnectionHeader().get());
    if (found == of_header.end())
      throw rosbag::BagFormatException("a message of a connection that it does not list");
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
  Topics result;
  for (const rosbag::ConnectionInfo* connection : connections) {
    const auto found =
        std::find_if(result.topics.begin(), result.topics.end(), [&](const BagTopic& topic) {
          return topic.name == connection->topic && topic.type == connection->datatype &&
                 topic.md5sum == connection->md5sum;
        });
    result.of_header[connection->header.get()] =
        static_cast<std::uint32_t>(found - result.topics.begin());
    const bool latching = header_field(*connection, "latching") == "1";
    if (found == result.topics.end())
      result.topics.push_back(
          {connection->topic, connection->datatype, connection->md5sum, latching});
    else
      found->latching = found->latching || latching;
  }
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
    const std::int64_t stamp = ros_message::nanoseconds_of(message.getTime());
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
                 .stamp_ns = ros_message::nanoseconds_of(message.getTime())},
                std::string_view(bytes).substr(0, wanted[topic]));
  }
}

BagTopic topic_from(const Parcel& parcel, const std::string& text) {
  const std::size_t first = text.find('\n');
  const std::size_t second = text.find('\n', first + 1);
  return {text.substr(0, first), text.substr(first + 1, second - first - 1),
          text.substr(second + 1), parcel.latching != 0, parcel.size};
}

}  // namespace

void require_ros() {}

BagListing list_bag(const fs::path& path) {
  require_bag(path);
  GuardedBag bag(path, send_listing);
  BagListing listing;
  std::int64_t start = std::numeric_limits<std::int64_t>::max();
  std::int64_t end = 0;
  std::string bytes;
  while (const std::optional<Parcel> parcel = bag.receive(bytes)) {
    listing.topics.push_back(topic_from(*parcel, bytes));
    listing.messages += parcel->size;
    start = std::min(start, parcel->stamp_ns);
    end = std::max(end, parcel->last_ns);
  }
  if (listing.messages > 0) {
    listing.start_s = ros_message::seconds_of(start);
    listing.end_s = ros_message::seconds_of(end);
  }
  return listing;
}

void read_bag(const fs::path& path, const std::vector<BagRequest>& requests,
              const std::function<void(const BagMessage&)>& take) {
  require_bag(path);
  if (requests.empty()) return;
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

const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const std::string& type, const std::string& md5sum) {
  std::vector<std::string> names;
  for (const BagTopic& topic : listing.topics) {
    if (topic.name == name && topic.type == type && topic.md5sum == md5sum) return topic;
    if (topic.name == name && topic.type == type)
      throw Error("is another definition of " + type,
                  {.field = "md5sum of " + name, .value = topic.md5sum, .bound = md5sum});
    if (topic.name == name)
      throw Error("is of another type",
                  {.field = "type of " + name, .value = topic.type, .bound = type});
    names.push_back(topic.name);
  }
  std::string known;
  for (const BagTopic& topic : listing.topics)
    if (topic.type == type) known += (known.empty() ? "one of " : ", ") + topic.name;
  throw Error("no such topic with messages" + did_you_mean(name, names),
              {.field = "topic", .value = name, .bound = known});
}

}  // namespace libmap
