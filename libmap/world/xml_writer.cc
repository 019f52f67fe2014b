#include "libmap/world/xml_writer.h"

#include <tinyxml2.h>

#include "libmap/core/angle.h"
#include "libmap/core/text.h"

namespace libmap {

std::string number_text(const Eigen::Ref<const Eigen::VectorXd>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : " ") + to_text(number + 0.0);
  return text;
}

std::string pose_text(const Pose& pose) {
  Eigen::VectorXd numbers(6);
  numbers << pose.translation(), radians_per_degree * roll_pitch_yaw_deg(pose);
  return number_text(numbers);
}

std::string color_text(const Color& color) {
  return number_text(Eigen::Vector4d(color[0], color[1], color[2], 255.0) / 255.0);
}

std::string numbered(const std::string& name, std::size_t n) {
  return name + "_" + std::to_string(n);
}

XmlWriter::XmlWriter(const std::vector<std::string>& comments)
    : printer_(std::make_unique<tinyxml2::XMLPrinter>()) {
  printer_->PushHeader(false, true);
  for (std::string comment : comments) {
    // XML forbids two hyphens in a comment, and one at its end.
    for (std::size_t at; (at = comment.find("--")) != std::string::npos;)
      comment.replace(at, 2, "- -");
    printer_->PushComment((" " + comment + " ").c_str());
  }
}

XmlWriter::~XmlWriter() = default;

void XmlWriter::open(const char* name, Attributes attributes) {
  printer_->OpenElement(name);
  for (const auto& [key, value] : attributes)
    if (!value.empty()) printer_->PushAttribute(key, value.c_str());
}

void XmlWriter::close() { printer_->CloseElement(); }

void XmlWriter::element(const char* name, Attributes attributes) {
  open(name, attributes);
  close();
}

void XmlWriter::text(const char* name, const std::string& text) {
  printer_->OpenElement(name);
  printer_->PushText(text.c_str());
  printer_->CloseElement();
}

std::string XmlWriter::str() const { return printer_->CStr(); }

}  // namespace libmap
