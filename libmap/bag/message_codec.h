// Encodes and decodes messages in the encodings of bags. Private to libmap/bag.
//
// ROS 1 (http://wiki.ros.org/msg#Fields): little-endian, without padding; a text or an array begins
// with the length as uint32. ROS 2: CDR, version 1 (DDS-XTypes 7.4.1): 4 bytes with the byte order,
// then each number at a multiple of the number's size; a text ends with a zero.
#pragma once

#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/ros_messages.h"

namespace libmap::ros_message {

// Decodes a message; ignores bytes after it. All characters of texts but printable ASCII become
// '?'. Throws Error for a truncated message, declared lengths beyond the end, or another encoding.
template <typename Message>
Message decode(MessageEncoding encoding, std::string_view bytes);

// Encodes a message; CDR is little-endian. Equal messages give equal bytes.
template <typename Message>
std::string encode(MessageEncoding encoding, const Message& message);

// Returns the message's definition of ROS 2 with the definitions of all parts, in MCAP's format
// "ros2msg" (https://mcap.dev/spec/registry), without comments and constants.
template <typename Message>
std::string definition_of();

}  // namespace libmap::ros_message
