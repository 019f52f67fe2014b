#include "tools/support/bag_json.h"

namespace graspmap_tools {

nlohmann::ordered_json bag_json(const libmap::BagListing& listing) {
  nlohmann::ordered_json json;
  json["messages"] = listing.messages;
  json["start_s"] = listing.start_s;
  json["end_s"] = listing.end_s;
  json["topics"] = nlohmann::ordered_json::array();
  for (const libmap::BagTopic& topic : listing.topics)
    json["topics"].push_back({{"name", topic.name},
                              {"type", topic.type},
                              {"md5sum", topic.md5sum},
                              {"messages", topic.messages},
                              {"latching", topic.latching}});
  return json;
}

}  // namespace graspmap_tools
