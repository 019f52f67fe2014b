#include "libmap/report/html.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "libmap/core/score_color.h"
#include "libmap/view/color_map.h"

namespace libmap {

namespace {

using Json = nlohmann::ordered_json;

// Color of obstacles, distinct from all other colors of the legends.
constexpr Color obstacle_color{122, 40, 140};

struct Swatch {
  std::string name;
  Color color;
  std::string text;
};

std::vector<Swatch> swatches() {
  std::vector<Swatch> all;
  for (std::size_t n = 0; n < score_classes.size(); ++n)
    all.push_back({"c" + std::to_string(n), score_classes[n].color, score_classes[n].text});
  all.push_back({"c7", no_value_color, "no value"});
  all.push_back({"c8", below_plane_color, "below the zero plane"});
  all.push_back({"convex", convex_color, "convex"});
  all.push_back({"graspable", graspable_color, "graspable"});
  all.push_back({"obstacle", obstacle_color, "obstacle"});
  all.push_back({"rest", rest_color, "other"});
  return all;
}

// Number of colors of the force scale.
constexpr int scale_steps = 64;

// Encodes cells: three little-endian 16-bit indices per cell, then one byte per cell.
std::string cell_bytes(const MapView& view) {
  std::string bytes;
  bytes.reserve(view.cells.size() * 7);
  for (const MapCell& cell : view.cells)
    for (const unsigned index : cell.index) {
      bytes += static_cast<char>(index & 255U);
      bytes += static_cast<char>(index >> 8U);
    }
  for (const MapCell& cell : view.cells) bytes += static_cast<char>(cell.colors_and_flags);
  return bytes;
}

Json markers_json(const MapView& view) {
  Json markers = Json::array();
  for (const MapMarker& marker : view.markers) {
    Json one;
    one["label"] = marker.label;
    // Relative to the lowest corner of the cells, rounded to 0.1 mm.
    one["at"] = Json::array();
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      one["at"].push_back(
          std::round((marker.point_in_terrain[axis] - view.corner_in_terrain[axis]) * 1e4) / 1e4);
    one["verdict"] = marker.verdict ? Json(*marker.verdict ? 1 : 0) : Json();
    markers.push_back(std::move(one));
  }
  return markers;
}

std::string view_json(const MapView& view) {
  Json json;
  json["cell_size_m"] = view.cell_size_m;
  json["cells"] = to_base64(cell_bytes(view));
  json["convex"] = view.has_convex;
  json["graspable"] = view.has_graspable;
  json["obstacle"] = view.has_obstacle;
  if (!view.forces.empty()) {
    std::string planes;
    for (const auto value :
         {&CellForce::median, &CellForce::low, &CellForce::high, &CellForce::probability})
      for (const CellForce& force : view.forces) planes += static_cast<char>(force.*value);
    json["forces"] = to_base64(planes);
    json["load_n"] = view.load_n;
    json["max_force_n"] = view.max_force_n;
  }
  json["markers"] = markers_json(view);
  return escape_json_in_script(json.dump(-1, ' ', true, Json::error_handler_t::replace));
}

// Fill attribute of an SVG shape. The Content-Security-Policy forbids style attributes.
std::string fill_of(const Color& color) {
  return fmt::format("fill=\"#{:02x}{:02x}{:02x}\"", color[0], color[1], color[2]);
}

std::string legend_html(const MapView& view) {
  std::array<bool, 9> used{};
  for (const MapCell& cell : view.cells)
    used[std::min<std::size_t>(cell.colors_and_flags & 15U, 8)] = true;
  const auto group = [](const std::string& mode, const std::string& title, bool hidden) {
    return fmt::format("<ul class=\"legend\" data-mode=\"{}\" aria-label=\"{}\"{}>", mode, title,
                       hidden ? " hidden" : "");
  };
  const auto entry = [](const Swatch& swatch) {
    return "<li><span class=\"swatch " + swatch.name + "\"></span>" + escape_html(swatch.text) +
           "</li>";
  };
  const std::vector<Swatch> all = swatches();
  std::string html = group("score", "Score", false);
  if (!view.forces.empty())
    html += "<li>Probability to hold <output>" + short_number(view.load_n) + " N</output></li>";
  for (std::size_t n = 0; n < 9; ++n)
    if (n < score_classes.size() || used[n]) html += entry(all[n]);
  html += "</ul>\n";
  if (!view.forces.empty()) {
    html += group("force", "Holding force", true) + "<li>Median of the holding force: 0 <svg " +
            fmt::format("class=\"scale\" viewBox=\"0 0 {} 1\" preserveAspectRatio=\"none\">",
                        scale_steps);
    for (int n = 0; n < scale_steps; ++n) {
      const Color color = viridis(n / (scale_steps - 1.0));
      html += fmt::format("<rect x=\"{}\" width=\"1.1\" height=\"1\" {}/>", n, fill_of(color));
    }
    html += "</svg> " + short_number(view.max_force_n) + " N and above</li>" +
            (used[8] ? entry(all[8]) : "") + "</ul>\n";
  }
  const auto flags = [&](const std::string& mode, std::vector<std::size_t> shown) {
    html += group(mode, mode, true);
    for (const std::size_t n : shown) html += entry(all[n]);
    html += entry(all[12]) + (used[8] ? entry(all[8]) : "") + "</ul>\n";
  };
  if (view.has_convex) flags("convex", {9});
  if (view.has_graspable)
    flags("graspable",
          view.has_convex ? std::vector<std::size_t>{10, 9} : std::vector<std::size_t>{10});
  if (view.has_obstacle) flags("obstacle", {11});
  return html;
}

std::string tools_html(const MapView& view) {
  const auto button = [](const std::string& mode, const std::string& text) {
    return "<button type=\"button\" data-mode=\"" + mode + "\" aria-pressed=\"" +
           (mode == "score" ? "true" : "false") + "\">" + text + "</button>";
  };
  std::string html = "<div class=\"tools\" hidden><div role=\"group\" aria-label=\"Colors\">" +
                     button("score", view.forces.empty() ? "Score" : "Probability");
  if (!view.forces.empty()) html += button("force", "Force");
  if (view.has_convex) html += button("convex", "Convex");
  if (view.has_graspable) html += button("graspable", "Graspable");
  if (view.has_obstacle) html += button("obstacle", "Obstacles");
  html +=
      "</div><div role=\"group\" aria-label=\"View\">"
      "<button type=\"button\" data-camera=\"oblique\">Oblique</button>"
      "<button type=\"button\" data-camera=\"top\">Top</button>";
  if (!view.markers.empty())
    html += "<button type=\"button\" data-labels aria-pressed=\"true\">Labels</button>";
  html += "</div>";
  if (!view.forces.empty())
    html += "<label>Load <input type=\"range\" min=\"-60\" max=\"60\" value=\"0\"> <output>" +
            short_number(view.load_n) + " N</output></label>";
  return html + "</div>\n";
}

std::string description(const MapView& view) {
  std::string text =
      fmt::format("{} cells of {} mm", view.cells.size(), short_number(view.cell_size_m * 1e3));
  if (view.cells.size() < view.voxels || view.voxels_per_cell > 1)
    text +=
        fmt::format(", one voxel shown for each cube of {0} x {0} x {0} of the map's {1} voxels",
                    view.voxels_per_cell, view.voxels);
  return text + ".";
}

constexpr double most_steps = 65535.0;
constexpr std::size_t most_short_vertices = 65536;

void append(std::string& bytes, std::uint32_t number, int size) {
  for (int byte = 0; byte < size; ++byte) bytes += static_cast<char>((number >> (8 * byte)) & 255U);
}

int index_size(const TriangleMesh& mesh) {
  return mesh.vertices.size() <= most_short_vertices ? 2 : 4;
}

// Encodes a mesh, little-endian: vertex indices of the triangles; 16-bit positions in steps from
// the lowest corner; vertex colors.
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
  Json json;
  json["cell_size_m"] = step_m;
  json["mesh"] = to_base64(mesh_bytes(mesh, box.min(), step_m));
  json["vertices"] = mesh.vertices.size();
  json["markers"] = Json::array();
  return escape_json_in_script(json.dump());
}

std::string scene_legend_html(const ReportScene& scene) {
  std::string html = "<ul class=\"legend\" aria-label=\"Colors\">";
  for (const auto& [color, text] : scene.legend)
    html += "<li><svg class=\"swatch\"><rect width=\"100%\" height=\"100%\" " + fill_of(color) +
            "/></svg>" + escape_html(text) + "</li>";
  return html + "</ul>\n";
}

}  // namespace

std::string map_html(const ReportMap& map, const std::string& preview, bool with_view) {
  std::string html = "<div class=\"viewer\"><div class=\"stage\">\n";
  if (with_view) html += tools_html(map.view);
  html += "<div class=\"viewport\">" + preview;
  if (with_view)
    html +=
        "<noscript><p>The 3-D view needs JavaScript.</p></noscript>"
        "<canvas tabindex=\"0\" role=\"img\" hidden aria-label=\"Graspability map, 3-D view: "
        "arrow keys turn it, plus and minus zoom\"></canvas>";
  if (!map.view.forces.empty()) html += "<p class=\"reading\" hidden></p>";
  html += "</div>\n" + legend_html(map.view);
  if (std::any_of(map.view.markers.begin(), map.view.markers.end(),
                  [](const MapMarker& marker) { return marker.verdict.has_value(); }))
    html +=
        "<ul class=\"legend\" aria-label=\"Locations\"><li><span class=\"mark pass\"></span>"
        "listed as graspable</li><li><span class=\"mark fail\"></span>listed as not "
        "graspable</li></ul>\n";
  if (with_view)
    html +=
        "<p class=\"hint\" hidden>Drag to turn, two fingers or the right button to move, the "
        "wheel to zoom after a click. " +
        description(map.view) + "</p>\n";
  html += "</div>\n";
  if (map.locations)
    html += "<div class=\"locations\">" +
            scroll_box(table_html(*map.locations, "data-place"), "Locations") + "</div>\n";
  html += "</div>\n";
  if (with_view)
    html += "<script type=\"application/json\" class=\"map-data\">" + view_json(map.view) +
            "</script>\n";
  return html;
}

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
  html += "</div>\n" + scene_legend_html(scene);
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

std::string palette_json() {
  Json json;
  for (const Swatch& swatch : swatches()) json[swatch.name] = swatch.color;
  for (const ScoreClass& one : score_classes)
    json["bounds"].push_back(std::max(0.0, one.min_score));
  for (int n = 0; n < scale_steps; ++n) json["scale"].push_back(viridis(n / (scale_steps - 1.0)));
  return escape_json_in_script(json.dump());
}

std::string palette_style() {
  std::string style;
  for (const Swatch& swatch : swatches())
    style += fmt::format(".swatch.{}{{background:#{:02x}{:02x}{:02x}}}\n", swatch.name,
                         swatch.color[0], swatch.color[1], swatch.color[2]);
  return style;
}

}  // namespace libmap
