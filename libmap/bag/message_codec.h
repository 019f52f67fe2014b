// Encodes and decodes messages in the encodings of bags. Private to libmap/bag.
//
// ROS 1 (http://wiki.ros.org/msg#Fields): little-endian, without padding; a text or an array begins
// with its uint32 length. ROS 2: CDR, version 1 (DDS-XTypes 7.4.1): 4 bytes that contain the byte
// order, then each number at a multiple of its size; a text ends with a zero byte.
#pragma once

#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/ros_messages.h"

namespace libmap::ros_message {

// Decodes a message and ignores bytes after it. In texts, all characters except printable ASCII
// become '?'. Throws Error for a truncated message, an invalid length, or encoding `other`.
template <typename Message>
Message decode(MessageEncoding encoding, std::string_view bytes);

// Encodes a message; CDR is little-endian. Equal messages have equal bytes.
template <typename Message>
std::string encode(MessageEncoding encoding, const Message& message);

// Returns the text of the message's ROS 2 definition and of the definitions that it uses, in MCAP's
// format "ros2msg" (https://mcap.dev/spec/registry), without comments and constants.
template <typename Message>
std::string definition_of();

}  // namespace libmap::ros_message
