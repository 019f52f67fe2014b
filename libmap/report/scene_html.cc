#include "libmap/report/scene_html.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "libmap/report/html.h"

namespace libmap {

namespace {

constexpr double most_steps = 65535.0;
constexpr std::size_t most_short_vertices = 65536;

void append(std::string& bytes, std::uint32_t number, int size) {
  for (int byte = 0; byte < size; ++byte) bytes += static_cast<char>((number >> (8 * byte)) & 255U);
}

int index_size(const TriangleMesh& mesh) {
  return mesh.vertices.size() <= most_short_vertices ? 2 : 4;
}

// Little-endian: the triangles' corners; positions in steps from the lowest corner, 16 bits each;
// colors.
std::string mesh_bytes(const TriangleMesh& mesh, const Eigen::Vector3d& corner, double step_m) {
  std::string bytes;
  bytes.reserve(scene_bytes(mesh));
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle) append(bytes, vertex, index_size(mesh));
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      append(bytes, static_cast<std::uint32_t>(std::lround((vertex[axis] - corner[axis]) / step_m)),
             2);
  for (std::size_t n = 0; n < mesh.vertices.size(); ++n) {
    constexpr Color gray{160, 160, 160};
    for (const std::uint8_t part : mesh.vertex_colors.empty() ? gray : mesh.vertex_colors[n])
      bytes += static_cast<char>(part);
  }
  return bytes;
}

std::string scene_json(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
  const double step_m = std::max(box.sizes().maxCoeff() / most_steps, 1e-9);
  nlohmann::ordered_json json;
  json["cell_size_m"] = step_m;
  json["mesh"] = to_base64(mesh_bytes(mesh, box.min(), step_m));
  json["vertices"] = mesh.vertices.size();
  json["markers"] = nlohmann::ordered_json::array();
  return escape_json_in_script(json.dump());
}

// No style of its own is allowed on an element, but a drawing may have any color.
std::string legend_html(const ReportScene& scene) {
  std::string html = "<ul class=\"legend\" aria-label=\"Colors\">";
  for (const auto& [color, text] : scene.legend)
    html += fmt::format(
        "<li><svg class=\"swatch\"><rect width=\"100%\" height=\"100%\" "
        "fill=\"#{:02x}{:02x}{:02x}\"/></svg>{}</li>",
        color[0], color[1], color[2], escape_html(text));
  return html + "</ul>\n";
}

}  // namespace

std::size_t scene_bytes(const TriangleMesh& mesh) {
  const std::size_t bytes = 9 * mesh.vertices.size() +
                            static_cast<std::size_t>(3 * index_size(mesh)) * mesh.triangles.size();
  return bytes * 4 / 3;
}

std::string scene_html(const ReportScene& scene, bool with_view) {
  std::string html = "<div class=\"viewer\"><div class=\"stage\">\n";
  if (with_view)
    html +=
        "<div class=\"tools\" hidden><div role=\"group\" aria-label=\"View\">"
        "<button type=\"button\" data-camera=\"oblique\">Oblique</button>"
        "<button type=\"button\" data-camera=\"top\">Top</button></div></div>\n";
  html += "<div class=\"viewport\"><p class=\"still\">Shown in 3-D only.</p>";
  if (with_view)
    html +=
        "<noscript><p>The 3-D view needs JavaScript.</p></noscript>"
        "<canvas tabindex=\"0\" role=\"img\" hidden aria-label=\"Scene, 3-D view: arrow keys turn "
        "it, plus and minus zoom\"></canvas>";
  html += "</div>\n" + legend_html(scene);
  if (with_view)
    html +=
        "<p class=\"hint\" hidden>Drag to turn, two fingers or the right button to move, the "
        "wheel to zoom after a click.</p>\n";
  html += "</div>\n</div>\n";
  if (with_view)
    html += "<script type=\"application/json\" class=\"map-data\">" + scene_json(scene.mesh) +
            "</script>\n";
  return html;
}

}  // namespace libmap
