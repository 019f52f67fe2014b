// ROS 1's storage, read by librosbag.
//
// A bag's own bytes say where its messages are, and librosbag follows them without checking whether
// they lead outside. So it runs in a process of its own, with 3 GiB of memory at most, and what it
// finds comes through a pipe: a bag on which it crashes is an Error here.
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>

#include "libmap/core/error.h"
#include "libmap/core/guarded_process.h"
#include "libmap/ros/bag_storage.h"
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

std::int64_t nanoseconds_of(const ros::Time& time) {
  return std::int64_t{time.sec} * 1'000'000'000 + time.nsec;
}

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
    sender.send_error("is broken or cut off: " + printable(error.what()));
  } catch (const std::bad_alloc&) {
    sender.send_error("is broken, or contains messages of more than 1 GiB");
  } catch (const std::exception& error) {
    // The loader of encryption plugins, for one.
    sender.send_error("cannot be read: " + printable(error.what()));
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

}  // namespace libmap
