#include "tools/support/tile_folder.h"

#include "libmap/core/json_input.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

TileFolder::TileData parse_tile_data(const std::string& text, const fs::path& file) {
  try {
    return libmap::parse_json<TileFolder::TileData>(text);
  } catch (const nlohmann::json::exception& error) {
    throw libmap::Error(std::string("cannot be parsed: ") + error.what(), {.file = file.string()});
  }
}

// Text of the JSON, with replacement characters for invalid UTF-8, which file names may contain.
std::string json_text(const TileFolder::TileData& json) {
  return json.dump(-1, ' ', false, TileFolder::TileData::error_handler_t::replace);
}

}  // namespace

void add_share_option(Command& command, std::string& share) {
  command.option("--tile", "K/N", share,
                 "compute only share K of N (1/N) of the tiles; all N shares complete the folder");
}

void require_folder_of_share(const std::string& output, const std::string& share) {
  if (is_tile_folder(output)) return;
  reject_given({{"--tile", share != whole_share}}, "requires a folder of tiles as output");
}

TileFolder::TileFolder(const std::string& output, const std::vector<std::string>& names,
                       const std::vector<std::string>& inputs, const libmap::TileShare& share,
                       Run& run)
    : output_(without_trailing_slash(output)),
      names_(names),
      inputs_(inputs),
      share_(share),
      run_(run),
      key_(libmap::key_of(run.manifest())),
      store_(output_ + ".progress") {
  if (share_.count == 1) {
    run_.claim_output_tree(output_, names_, inputs_);
    return;
  }
  run_.check_output_tree(output_, inputs_);
  if (run_.options().force)
    throw libmap::Error("deletes the tiles of all shares and cannot be combined with --tile",
                        {.field = "--force"});
  if (!run_.options().dry_run) earlier_plan();
}

// Returns the earlier plan with the same parameters and inputs. Throws if a share's plan differs.
std::optional<TileFolder::TileData> TileFolder::earlier_plan() const {
  const auto text = run_.options().force ? std::nullopt : store_.plan_text();
  if (!text) return std::nullopt;
  TileData plan = parse_tile_data(*text, store_.plan_path());
  if (plan.at("key") == key_) return plan;
  if (share_.count == 1) return std::nullopt;
  throw libmap::Error(
      "contains tiles of another input or other parameters; use --force without --tile to replace "
      "them",
      {.file = store_.folder().string()});
}

bool TileFolder::is_assembled() const {
  if (share_.count == 1 || !fs::is_directory(output_)) return false;
  const auto manifest = libmap::read_manifest_of(output_);
  return manifest && libmap::key_of(*manifest) == key_;
}

bool TileFolder::is_complete() const {
  if (!is_assembled()) return false;
  run_.info("all tiles are complete");
  return true;
}

// Removes the store if bad input ends a run of all tiles, because a resumed run would fail too.
template <typename Step>
void TileFolder::resumable(const Step& step) {
  try {
    step();
  } catch (const libmap::Error& error) {
    if (error.kind() == libmap::ErrorKind::bad_input && share_.count == 1) remove_store();
    throw;
  }
}

TileFolder::TileData TileFolder::begin(const std::function<TileData()>& find) {
  if (run_.options().dry_run) return {};
  resumable([&] { journal_.emplace(store_.begin(share_, [&] { check_plan(find); })); });
  return common_;
}

void TileFolder::check_plan(const std::function<TileData()>& find) {
  if (const auto earlier = earlier_plan()) {
    common_ = earlier->at("common");
    return;
  }
  store_.require_idle();
  store_.clear();
  common_ = find();
  store_.write_plan(TileData{{"key", key_}, {"common", common_}}.dump());
}

void TileFolder::find_done() {
  done_.clear();
  store_.each_line([this](const std::string& text, const libmap::TileStore::Line& line) {
    const TileData data = TileData::parse(text, nullptr, false);
    if (data.is_object() && data.value("key", TileData()) == key_ && data.contains("tile"))
      done_[json_text(data.at("tile"))] = line;
  });
}

bool TileFolder::is_done(const std::string& tile) const { return done_.contains(json_text(tile)); }

TileFolder::TileData TileFolder::tile_data(const std::string& tile) const {
  const libmap::TileStore::Line& line = done_.at(json_text(tile));
  return parse_tile_data(libmap::TileStore::read_line(line), line.journal);
}

void TileFolder::make(const Work& work) {
  if (run_.options().dry_run) return;
  if (!journal_) begin();
  resumable([&] {
    run_.timed("tiles", [&] { make_missing(work); });
    assemble(work);
  });
}

void TileFolder::make_missing(const Work& work) {
  find_done();
  std::vector<std::size_t> missing;
  const auto [first, last] = libmap::share_range(work.tiles.size(), share_);
  for (std::size_t n = first; n < last; ++n)
    if (!is_done(work.tiles[n])) missing.push_back(n);
  run_.progress().begin("tiles", missing.size());
  for (const std::size_t n : missing) {
    libmap::OutputFile tile(file(work.tiles[n], work.extension));
    TileData data = work.make(n, tile.temporary_path());
    if (fs::file_size(tile.temporary_path()) > 0) tile.commit();
    data["key"] = key_;
    data["tile"] = work.tiles[n];
    journal_->add({json_text(data)});
    run_.progress().advance(1);
  }
  run_.progress().end();
}

void TileFolder::assemble(const Work& work) {
  find_done();
  const auto done = static_cast<std::size_t>(
      std::count_if(work.tiles.begin(), work.tiles.end(),
                    [this](const std::string& tile) { return is_done(tile); }));
  // Another share may have been the last one too and may have removed the store.
  if (done < work.tiles.size() && !is_assembled())
    return run_.info("{} of {} tiles are complete", done, work.tiles.size());
  if (share_.count > 1) {
    try {
      run_.claim_output_tree(output_, names_, inputs_);
    } catch (const libmap::Error& error) {
      if (error.kind() != libmap::ErrorKind::failed) throw;
      return run_.info("another share completes the folder");
    }
  }
  if (!is_assembled()) run_.write_output_tree(output_, names_, work.finish);
  remove_store();
}

void TileFolder::remove_store() const {
  std::error_code ignored;
  fs::remove_all(store_.folder(), ignored);
}

void TileFolder::link_file(const fs::path& file, const fs::path& to) {
  std::error_code code;
  fs::create_hard_link(file, to, code);
  if (code) fs::copy_file(file, to);
}

}  // namespace graspmap_tools
