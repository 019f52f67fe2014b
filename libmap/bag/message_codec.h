// Messages as the bytes that bags store. Private to libmap/bag.
//
// ROS 1 (http://wiki.ros.org/msg#Fields): little-endian, without padding; a text or an array begins
// with its length as uint32. ROS 2: CDR, version 1 (DDS-XTypes 7.4.1): 4 bytes that tell the byte
// order, then each number at a multiple of its size; a text ends with a zero.
#pragma once

#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/ros_messages.h"

namespace libmap::ros_message {

// Bytes behind the message are ignored. Texts become one line of ASCII, as ROS's names are. Throws
// Error: a message that ends too early or promises more than it contains, another encoding.
template <typename Message>
Message decode(MessageEncoding encoding, std::string_view bytes);

// The message's bytes; CDR is little-endian. Equal messages give equal bytes.
template <typename Message>
std::string encode(MessageEncoding encoding, const Message& message);

// The message's definition of ROS 2 with those that it contains, as MCAP wants it ("ros2msg",
// https://mcap.dev/spec/registry), without comments and constants.
template <typename Message>
std::string definition_of();

}  // namespace libmap::ros_message
