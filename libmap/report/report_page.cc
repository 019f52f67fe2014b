#include "libmap/report/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/report/html.h"
#include "libmap/report/image_fit.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Maximum rows per table if the page is too large otherwise.
constexpr std::size_t short_table_rows = 100;

std::string gaps_html(const std::vector<ReportGap>& gaps) {
  std::string html;
  for (const ReportGap& gap : gaps)
    html += "<p class=\"gap\"><code>" + escape_html(gap.file) +
            "</code> cannot be shown: " + escape_html(gap.reason) + "</p>\n";
  return html;
}

std::string image_html(const ReportImage& image, const std::string& alternative) {
  std::string size;
  if (image.width > 0) size = fmt::format(" width=\"{}\" height=\"{}\"", image.width, image.height);
  return "<img alt=\"" + escape_html(alternative) + "\"" + size +
         " src=\"data:" + image.media_type + ";base64," + to_base64(image.bytes) + "\">";
}

class PageWriter {
 public:
  explicit PageWriter(const PageAssets& assets) : with_views_(!assets.libraries.empty()) {}

  std::string section(const ReportSection& section, int level) {
    const std::string id = "s" + std::to_string(++sections_);
    contents_ += "<li><a href=\"#" + id + "\">" + escape_html(section.heading) + "</a>";
    const int heading = std::min(level, 6);
    std::string html = fmt::format("<section aria-labeledby=\"{}\">\n<h{} id=\"{}\">{}</h{}>\n", id,
                                   heading, id, escape_html(section.heading), heading);
    for (const ReportItem& one : section.items) html += item(one);
    if (!section.sections.empty()) contents_ += "\n<ol>\n";
    for (const ReportSection& inner : section.sections) html += this->section(inner, level + 1);
    if (!section.sections.empty()) contents_ += "</ol>\n";
    contents_ += "</li>\n";
    return html + "</section>\n";
  }

  std::string item(const ReportItem& item) {
    const std::string body =
        std::visit([&](const auto& held) { return body_html(held, item); }, item.body);
    return body + gaps_html(item.gaps);
  }

  std::string sources(const ReportContent& content) {
    if (content.sources.empty()) return "";
    contents_ += "<li><a href=\"#provenance\">Provenance</a></li>\n";
    return "<section aria-labeledby=\"provenance\" class=\"provenance\">\n"
           "<h2 id=\"provenance\">Provenance</h2>\n<p>Every output of this run with the command "
           "that "
           "made it, its parameters, its inputs with their SHA-256, and its results.</p>\n" +
           sources_html(content) + "</section>\n";
  }

  const std::string& contents() const { return contents_; }
  bool has_views() const { return has_views_; }

 private:
  std::string figure(const std::string& kind, const std::string& number, const ReportItem& item,
                     const std::string& body, const std::string& otherwise) {
    std::string caption = "<figcaption>";
    if (!number.empty()) caption += "<b>" + number + ".</b> ";
    caption += escape_html(item.caption.empty() ? otherwise : item.caption);
    if (!item.source.empty())
      caption += " <code class=\"source\">" + escape_html(item.source) + "</code>";
    caption += "</figcaption>\n";
    // Captions of tables are above, those of images below.
    const bool above = kind == "table" || kind == "map" || kind == "listing";
    return "<figure class=\"" + kind + "\">\n" + (above ? caption + body : body + caption) +
           "</figure>\n";
  }

  std::string table_number() { return "Table " + std::to_string(++tables_); }
  std::string figure_number() { return "Figure " + std::to_string(++figures_); }

  std::string body_html(const std::monostate&, const ReportItem& item) {
    if (item.caption.empty()) return "";
    return "<p class=\"caption\">" + escape_html(item.caption) + "</p>\n";
  }

  std::string body_html(const ReportImages& images, const ReportItem& item) {
    const std::string number = figure_number();
    std::string html =
        fmt::format("<div class=\"pictures n{}\">\n", std::min<std::size_t>(images.size(), 4));
    std::string changes;
    for (const ReportImage& image : images) {
      std::string alternative = image.label.empty() ? item.caption : image.label;
      if (alternative.empty()) alternative = image.file;
      html += "<div class=\"picture\">" + image_html(image, alternative);
      if (!image.label.empty())
        html += "<span class=\"label\">" + escape_html(image.label) + "</span>";
      html += "</div>\n";
      if (!image.change.empty())
        changes += (changes.empty() ? "" : "; ") + fs::path(image.file).filename().string() + ": " +
                   image.change;
    }
    html += "</div>\n";
    std::string whole = figure("picture", number, item, html, images.front().file);
    if (!changes.empty())
      whole.insert(whole.rfind("</figure>"), "<p class=\"changed\">Made smaller for this page. " +
                                                 escape_html(changes) + ".</p>\n");
    return whole;
  }

  std::string body_html(const ReportTable& table, const ReportItem& item) {
    std::string html =
        scroll_box(table_html(table), item.caption.empty() ? item.source : item.caption);
    if (table.lines)
      html += fmt::format("<p class=\"changed\">The first {} rows of {}.</p>\n",
                          table.table.rows.size(), *table.lines - 1);
    return figure("table", table_number(), item, html, "");
  }

  std::string body_html(const ReportMap& map, const ReportItem& item) {
    const std::string number = figure_number();
    const bool view = with_views_ && !map.view.cells.empty();
    has_views_ = has_views_ || view;
    const std::string caption = item.caption.empty() ? "Graspability map." : item.caption;
    const std::string preview =
        map.preview ? "<div class=\"still\">" + image_html(*map.preview, caption) + "</div>"
                    : "<p class=\"still\">No image of this map was made.</p>";
    return figure("map", number, item, map_html(map, preview, view), "Graspability map.");
  }

  std::string body_html(const ReportScene& scene, const ReportItem& item) {
    const std::string number = figure_number();
    has_views_ = has_views_ || with_views_;
    return figure("map", number, item, scene_html(scene, with_views_), "Scene.");
  }

  std::string body_html(const ReportParameters& parameters, const ReportItem& item) {
    const std::string html = parameters_html(parameters);
    if (parameters.outputs.size() == 1) return "<div class=\"parameters\">" + html + "</div>\n";
    return figure("table", table_number(), item, html, "Parameters and results.");
  }

  std::string body_html(const TimingTable& table, const ReportItem& item) {
    std::string html = scroll_box(timings_html(table), "Running times");
    html += "<p class=\"changed\">Wall time in milliseconds, from the manifests of the outputs.";
    if (table.sums)
      html +=
          " If several outputs of a column have the same step, such as the shares of one map, "
          "their times are summed.";
    return figure("table", table_number(), item, html + "</p>\n", "Running times.");
  }

  std::string body_html(const ReportListing& listing, const ReportItem& item) {
    std::string html =
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Text\"><pre>" +
        escape_html(listing.text) + "</pre></div>\n";
    if (listing.omitted_lines > 0)
      html += fmt::format("<p class=\"changed\">{} more lines are omitted.</p>\n",
                          listing.omitted_lines);
    return figure("listing", "", item, html, "");
  }

  bool with_views_ = false;
  bool has_views_ = false;
  int sections_ = 0;
  int figures_ = 0;
  int tables_ = 0;
  std::string contents_;
};

std::string head_html(const ReportContent& content, const PageAssets& assets,
                      const std::string& style, const std::vector<std::string>& scripts) {
  std::string script_hashes;
  for (const std::string& script : scripts) script_hashes += " " + csp_hash(script);
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src "
         "data:; "
         "style-src " +
         csp_hash(style) + "; script-src" + script_hashes +
         "; base-uri 'none'; form-action 'none'\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta name=\"color-scheme\" content=\"light dark\">\n"
         "<meta name=\"referrer\" content=\"no-referrer\">\n"
         "<meta name=\"generator\" content=\"graspmap " +
         escape_html(assets.version) +
         "\">\n"
         "<link rel=\"icon\" href=\"data:,\">\n<title>" +
         escape_html(content.heading) + "</title>\n<style>" + style + "</style>\n</head>\n";
}

std::string count_text(const ReportContent& content, const PageAssets& assets) {
  const std::size_t outputs = content.sources.size() + content.more_sources;
  std::string text = "Made by graspmap " + escape_html(assets.version);
  if (outputs > 0)
    text += fmt::format(
        " from {} output{}, each with its parameters and inputs under "
        "<a href=\"#provenance\">Provenance</a>",
        outputs, outputs == 1 ? "" : "s");
  return text + ".";
}

template <typename Visit>
void each_item(ReportSection& section, const Visit& visit) {
  for (ReportItem& item : section.items) visit(item);
  for (ReportSection& inner : section.sections) each_item(inner, visit);
}

std::vector<ReportImage*> images_of(ReportContent& content) {
  std::vector<ReportImage*> found;
  each_item(content, [&](ReportItem& item) {
    if (auto* images = std::get_if<ReportImages>(&item.body))
      for (ReportImage& image : *images) found.push_back(&image);
    auto* map = std::get_if<ReportMap>(&item.body);
    if (map != nullptr && map->preview) found.push_back(&*map->preview);
  });
  return found;
}

// Truncates all tables. Returns true if any table was longer.
bool cut_tables(ReportContent& content, std::size_t max_rows) {
  bool any = false;
  each_item(content, [&](ReportItem& item) {
    auto* table = std::get_if<ReportTable>(&item.body);
    if (table == nullptr || table->table.rows.size() <= max_rows) return;
    any = true;
    if (!table->lines) table->lines = table->table.rows.size() + 1;
    table->table.rows.resize(max_rows);
  });
  return any;
}

}  // namespace

std::string report_page(const ReportContent& content, const PageAssets& assets) {
  PageWriter writer(assets);
  std::string main;
  for (const ReportItem& item : content.items) main += writer.item(item);
  for (const ReportSection& section : content.sections) main += writer.section(section, 2);
  main += writer.sources(content);

  std::vector<std::string> scripts;
  if (writer.has_views())
    for (const std::string& library : assets.libraries) scripts.push_back(escape_code(library));
  for (const std::string& script : assets.scripts) scripts.push_back(escape_code(script));
  const std::string style = "\n" + escape_code(assets.style) + palette_style();

  std::string html = head_html(content, assets, style, scripts);
  html += "<body>\n<a class=\"skip\" href=\"#content\">Skip to the content</a>\n<header>\n<h1>" +
          escape_html(content.heading) + "</h1>\n<p>" + count_text(content, assets) +
          "</p>\n</header>\n<div class=\"page\">\n";
  if (!writer.contents().empty())
    html += "<nav aria-label=\"Contents\"><ol>\n" + writer.contents() + "</ol></nav>\n";
  html += "<main id=\"content\">\n" + main + "</main>\n</div>\n";
  if (writer.has_views())
    html += "<footer><details><summary>Software in this file</summary><pre>" +
            escape_html(assets.library_notice) + "</pre></details></footer>\n";
  html += "<script type=\"application/json\" id=\"palette\">" + palette_json() + "</script>\n";
  for (const std::string& script : scripts) html += "<script>" + script + "</script>\n";
  return html + "</body>\n</html>\n";
}

FittedPage fit_report_page(ReportContent content, const PageAssets& assets, std::size_t max_bytes) {
  const std::vector<ReportImage*> images = images_of(content);
  std::vector<ReportImage> originals;
  originals.reserve(images.size());
  for (const ReportImage* image : images) originals.push_back(*image);
  FittedPage page;
  do {
    for (page.image_level = 0; page.image_level <= max_image_level; ++page.image_level) {
      parallel_each(images.size(),
                    [&](std::size_t n) { *images[n] = fit_image(originals[n], page.image_level); });
      page.html = report_page(content, assets);
      if (page.html.size() <= max_bytes) {
        page.changed_images = static_cast<std::size_t>(std::count_if(
            images.begin(), images.end(), [](const auto* one) { return !one->change.empty(); }));
        return page;
      }
      if (images.empty()) break;  // higher levels change nothing
    }
  } while (cut_tables(content, short_table_rows));
  throw Error("the report is too large, even with reduced images and tables",
              {.field = "size",
               .value = fmt::format("{:.1f} MB", static_cast<double>(page.html.size()) / 1e6),
               .bound = fmt::format("<= {:.1f} MB", static_cast<double>(max_bytes) / 1e6)});
}

}  // namespace libmap
