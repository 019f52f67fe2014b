#include "libmap/mesh/mesh_text.h"

#include <string>

#include "libmap/core/text.h"

namespace libmap {
namespace {

template <typename Vector>
std::string numbers(const Vector& vector) {
  return to_text(vector[0]) + ' ' + to_text(vector[1]) + ' ' + to_text(vector[2]);
}

std::string color_text(const Color& color) {
  std::string text;
  for (const std::uint8_t channel : color)
    text += ' ' + to_text(static_cast<float>(channel) / 255.0F);
  return text;
}

}  // namespace

void write_obj(const TriangleMesh& mesh, std::ostream& out) {
  const bool colored = !mesh.vertex_colors.empty();
  const bool has_normals = !mesh.vertex_normals.empty();
  std::string line;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    line = "v " + numbers(mesh.vertices[i]);
    if (colored) line += color_text(mesh.vertex_colors[i]);
    out << line << '\n';
  }
  for (const Eigen::Vector3f& normal : mesh.vertex_normals) out << "vn " + numbers(normal) + "\n";
  for (const Triangle& triangle : mesh.triangles) {
    line = "f";
    for (const std::uint32_t corner : triangle) {
      // Indices count from 1.
      const std::string index = std::to_string(std::uint64_t{corner} + 1);
      line += ' ' + index;
      if (has_normals) line += "//" + index;
    }
    out << line << '\n';
  }
}

void write_off(const TriangleMesh& mesh, std::ostream& out) {
  out << "OFF\n" + std::to_string(mesh.vertices.size()) + ' ' +
             std::to_string(mesh.triangles.size()) + " 0\n";
  for (const Eigen::Vector3d& vertex : mesh.vertices) out << numbers(vertex) + "\n";
  for (const Triangle& triangle : mesh.triangles)
    out << "3 " + std::to_string(triangle[0]) + ' ' + std::to_string(triangle[1]) + ' ' +
               std::to_string(triangle[2]) + "\n";
}

}  // namespace libmap
