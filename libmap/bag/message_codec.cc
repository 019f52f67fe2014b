#include "libmap/bag/message_codec.h"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastcdr/exceptions/Exception.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <set>
#include <type_traits>

#include "libmap/core/error.h"

namespace libmap::ros_message {

namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

constexpr std::int64_t nanoseconds_per_second = 1'000'000'000;

template <typename T>
constexpr bool is_number = std::is_arithmetic_v<T>;

class Ros1Input {
 public:
  static constexpr bool ros2 = false;
  explicit Ros1Input(std::string_view bytes) : bytes_(bytes) {}

  std::size_t remaining() const { return bytes_.size(); }
  template <typename T>
  void numbers(T* values, std::size_t count) {
    if (count > remaining() / sizeof(T)) throw std::length_error("too short");
    if (count == 0) return;  // an empty vector has no address
    std::memcpy(values, bytes_.data(), count * sizeof(T));
    bytes_.remove_prefix(count * sizeof(T));
  }

 private:
  std::string_view bytes_;
};

class CdrInput {
 public:
  static constexpr bool ros2 = true;
  // Fast CDR requires mutable bytes, although it only reads them.
  explicit CdrInput(std::string_view bytes)
      : size_(bytes.size()),
        buffer_(const_cast<char*>(bytes.data()), bytes.size()),
        cdr_(buffer_, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR) {
    cdr_.read_encapsulation();
  }

  std::size_t remaining() const { return size_ - cdr_.getSerializedDataLength(); }
  template <typename T>
  void numbers(T* values, std::size_t count) {
    if (count > 0) cdr_.deserializeArray(values, count);
  }

 private:
  std::size_t size_;
  FastBuffer buffer_;
  Cdr cdr_;
};

class Ros1Output {
 public:
  static constexpr bool ros2 = false;

  template <typename T>
  void numbers(const T* values, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// Replaces Fast CDR, which does not initialize padding, so that equal messages would differ.
class CdrOutput {
 public:
  static constexpr bool ros2 = true;

  template <typename T>
  void numbers(const T* values, std::size_t count) {
    if (count == 0) return;
    const std::size_t behind = (bytes_.size() - head_bytes) % sizeof(T);
    if (behind > 0) bytes_.append(sizeof(T) - behind, '\0');
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
  }
  std::string take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t head_bytes = 4;
  std::string bytes_ = std::string("\0\1\0\0", head_bytes);  // CDR, little-endian, no options
};

// Visitor that reads each field.
template <typename Input>
class Reader {
 public:
  static constexpr bool ros2 = Input::ros2;
  explicit Reader(std::string_view bytes) : input_(bytes) {}

  template <typename T>
  void operator()(const char* /*name*/, T& value) {
    read(value);
  }

 private:
  template <typename T>
  void read(T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t byte = 0;
      input_.numbers(&byte, 1);
      value = byte != 0;
    } else if constexpr (is_number<T>) {
      input_.numbers(&value, 1);
    } else {
      T::fields(value, *this);
    }
  }
  void read(Time& time) {
    std::uint32_t parts[2] = {};
    input_.numbers(parts, 2);
    const std::int64_t seconds =
        ros2 ? static_cast<std::int32_t>(parts[0]) : std::int64_t{parts[0]};
    time.nanoseconds = seconds * nanoseconds_per_second + parts[1];
  }
  void read(std::string& text) {
    std::size_t length = count(1);
    text.resize(length);
    input_.numbers(text.data(), length);
    if (ros2 && text.ends_with('\0')) text.pop_back();
    text = printable(text);
  }
  template <typename T, std::size_t Size>
  void read(std::array<T, Size>& values) {
    input_.numbers(values.data(), Size);
  }
  template <typename T>
  void read(std::vector<T>& values) {
    if constexpr (is_number<T>) {
      values.resize(count(sizeof(T)));
      input_.numbers(values.data(), values.size());
    } else {
      // One by one, so that memory depends on the actual size, not on the declared one.
      for (std::size_t left = count(1); left > 0; --left) read(values.emplace_back());
    }
  }

  // Reads the length of an array whose elements have at least `element_bytes` bytes.
  std::size_t count(std::size_t element_bytes) {
    std::uint32_t value = 0;
    input_.numbers(&value, 1);
    if (value > input_.remaining() / element_bytes) throw std::length_error("too long");
    return value;
  }

  Input input_;
};

template <typename Output>
class Writer {
 public:
  static constexpr bool ros2 = Output::ros2;

  template <typename T>
  void operator()(const char* /*name*/, const T& value) {
    write(value);
  }
  std::string take() { return output_.take(); }

 private:
  template <typename T>
  void write(const T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      write(static_cast<std::uint8_t>(value));
    } else if constexpr (is_number<T>) {
      output_.numbers(&value, 1);
    } else {
      T::fields(value, *this);
    }
  }
  void write(const Time& time) {
    const std::uint32_t parts[2] = {
        static_cast<std::uint32_t>(time.nanoseconds / nanoseconds_per_second),
        static_cast<std::uint32_t>(time.nanoseconds % nanoseconds_per_second)};
    output_.numbers(parts, 2);
  }
  void write(const std::string& text) {
    const std::size_t length = text.size() + (ros2 ? 1 : 0);
    write(static_cast<std::uint32_t>(length));
    output_.numbers(text.c_str(), length);
  }
  template <typename T, std::size_t Size>
  void write(const std::array<T, Size>& values) {
    output_.numbers(values.data(), Size);
  }
  template <typename T>
  void write(const std::vector<T>& values) {
    write(static_cast<std::uint32_t>(values.size()));
    if constexpr (is_number<T>) {
      output_.numbers(values.data(), values.size());
    } else {
      for (const T& value : values) write(value);
    }
  }

  Output output_;
};

// Visitor that collects the definition of a message and of the messages in it.
class Definition {
 public:
  static constexpr bool ros2 = true;

  template <typename T>
  void operator()(const char* name, const T& value) {
    lines_ += type_of(value) + " " + name + "\n";
  }
  template <typename Message>
  void add(const Message& message) {
    Definition own(known_);
    Message::fields(message, own);
    lines_ += own.lines_ + own.others_;
  }
  const std::string& text() const { return lines_; }

  explicit Definition(std::set<std::string>& known) : known_(known) {}

 private:
  static std::string type_of(bool) { return "bool"; }
  static std::string type_of(std::int8_t) { return "int8"; }
  static std::string type_of(std::uint8_t) { return "uint8"; }
  static std::string type_of(std::uint16_t) { return "uint16"; }
  static std::string type_of(std::int32_t) { return "int32"; }
  static std::string type_of(std::uint32_t) { return "uint32"; }
  static std::string type_of(float) { return "float32"; }
  static std::string type_of(double) { return "float64"; }
  static std::string type_of(const std::string&) { return "string"; }
  std::string type_of(const Time&) {
    add_section("builtin_interfaces/Time", [] { return "int32 sec\nuint32 nanosec\n"; });
    return "builtin_interfaces/Time";
  }
  template <typename T>
  std::string type_of(const std::vector<T>&) {
    return type_of(T{}) + "[]";
  }
  template <typename T, std::size_t Size>
  std::string type_of(const std::array<T, Size>&) {
    return type_of(T{}) + "[" + std::to_string(Size) + "]";
  }
  template <typename Message>
  std::string type_of(const Message& message) {
    add_section(Message::type.name, [&] {
      Definition section(known_);
      section.add(message);
      return section.text();
    });
    return Message::type.name;
  }
  template <typename Text>
  void add_section(const std::string& name, const Text& text) {
    if (!known_.insert(name).second) return;
    others_ += std::string(80, '=') + "\nMSG: " + name + "\n" + text();
  }

  std::set<std::string>& known_;
  std::string lines_;
  std::string others_;
};

template <typename Input, typename Message>
Message read_message(std::string_view bytes) {
  Message message;
  Reader<Input> reader(bytes);
  Message::fields(message, reader);
  return message;
}

template <typename Output, typename Message>
std::string write_message(const Message& message) {
  Writer<Output> writer;
  Message::fields(message, writer);
  return writer.take();
}

}  // namespace

template <typename Message>
Message decode(MessageEncoding encoding, std::string_view bytes) {
  if (encoding == MessageEncoding::other)
    throw Error("is neither ROS 1's encoding nor CDR", {.field = "encoding of the messages"});
  try {
    return encoding == MessageEncoding::ros1 ? read_message<Ros1Input, Message>(bytes)
                                             : read_message<CdrInput, Message>(bytes);
  } catch (const std::length_error&) {
  } catch (const eprosima::fastcdr::exception::Exception&) {
  }
  throw Error(
      "damaged: declares more data than its " + std::to_string(bytes.size()) + " bytes contain",
      {.field = "message"});
}

template <typename Message>
std::string encode(MessageEncoding encoding, const Message& message) {
  return encoding == MessageEncoding::ros1 ? write_message<Ros1Output>(message)
                                           : write_message<CdrOutput>(message);
}

template <typename Message>
std::string definition_of() {
  std::set<std::string> known;
  Definition definition(known);
  definition.add(Message{});
  return definition.text();
}

template Head<Image> decode(MessageEncoding, std::string_view);
template Head<CompressedImage> decode(MessageEncoding, std::string_view);
#define GRASPMAP_MESSAGE(Message)                               \
  template Message decode(MessageEncoding, std::string_view);   \
  template std::string encode(MessageEncoding, const Message&); \
  template std::string definition_of<Message>()
GRASPMAP_MESSAGE(Image);
GRASPMAP_MESSAGE(CompressedImage);
GRASPMAP_MESSAGE(CameraInfo);
GRASPMAP_MESSAGE(PointCloud2);
GRASPMAP_MESSAGE(TFMessage);
GRASPMAP_MESSAGE(PoseArray);
GRASPMAP_MESSAGE(MarkerArray);
GRASPMAP_MESSAGE(OccupancyGrid);
GRASPMAP_MESSAGE(GridMap);
#undef GRASPMAP_MESSAGE

}  // namespace libmap::ros_message
