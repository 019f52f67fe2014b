// Writes XML by TinyXML-2, and converts values to XML text. Private to libmap/world.
#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace tinyxml2 {
class XMLPrinter;
}

namespace libmap {

// Numbers separated by spaces.
std::string number_text(const Eigen::Ref<const Eigen::VectorXd>& numbers);

class XmlWriter {
 public:
  using Attributes = std::initializer_list<std::pair<const char*, std::string>>;

  // The comments are written ahead of the document.
  explicit XmlWriter(const std::vector<std::string>& comments);
  ~XmlWriter();
  XmlWriter(const XmlWriter&) = delete;
  XmlWriter& operator=(const XmlWriter&) = delete;

  // Writes an element; content() writes its children.
  template <typename Content>
  void element(const char* name, Attributes attributes, const Content& content) {
    open(name, attributes);
    content();
    close();
  }
  void element(const char* name, Attributes attributes);
  // Writes an element that contains a text.
  void text(const char* name, const std::string& text);

  // Returns the document.
  std::string str() const;

 private:
  void open(const char* name, Attributes attributes);
  void close();

  std::unique_ptr<tinyxml2::XMLPrinter> printer_;
};

// "x y z roll pitch yaw", m and rad.
std::string pose_text(const Pose& pose);

// "red green blue alpha", 0 to 1.
std::string color_text(const Color& color);

// "NAME_N".
std::string numbered(const std::string& name, std::size_t n);

}  // namespace libmap
