// Functions of all commands: help, usage errors, effective parameters, overwriting, manifests.
#include <gtest/gtest.h>

#include "libmap/core/manifest.h"
#include "tests/tools/tool_test_support.h"

namespace command_line_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using graspmap_test::wrong_usage;
using Words = std::vector<std::string>;

// A quick run: convexity is not evaluated.
ProgramResult score_quickly(Words more) {
  Words words = {"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.csv"};
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

TEST(CommandLine, HelpAndVersion) {
  const ProgramResult help = graspmap({"--help"});
  EXPECT_TRUE(succeeded(help));
  EXPECT_EQ(graspmap({}).standard_output, help.standard_output);
  for (const char* command : {"score", "lookup", "evaluate", "info", "convert"}) {
    EXPECT_NE(help.standard_output.find(command), std::string::npos) << command;
    const ProgramResult one = graspmap({command, "--help"});
    EXPECT_TRUE(succeeded(one));
    EXPECT_NE(one.standard_output.find(std::string("graspmap ") + command), std::string::npos);
    EXPECT_NE(one.standard_output.find("--force"), std::string::npos);
    EXPECT_EQ(one.standard_error, "");
  }
  EXPECT_TRUE(graspmap({"--version"}).standard_output.starts_with("graspmap "));
}

TEST(CommandLine, HelpShowsUnitsAndDefaults) {
  const std::string help = graspmap({"score", "--help"}).standard_output;
  for (const char* part :
       {"--voxel-size M", "[0.01]", "--method thesis|envelope|climblab|corrected|calibrated",
        "[calibrated]", "--solid-voxel-threshold N", "[120]"})
    EXPECT_NE(help.find(part), std::string::npos) << part << "\n" << help;
}

TEST(CommandLine, UnknownCommandsAndFlags) {
  EXPECT_TRUE(wrong_usage(graspmap({"scor"}), {"scor", "'score'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"rendre"}), {"rendre", "'render'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"xyzzy"}), {"xyzzy"}));
  EXPECT_TRUE(wrong_usage(graspmap({"score", "t.pcd", "-o", "m.pcd", "--voxl-size", "1"}),
                          {"--voxl-size", "'--voxel-size'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"lookup", "m.pcd", "p.csv", "-o", "l.csv", "--max-distence=1"}),
                          {"--max-distence", "'--max-distance'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"convert", "a", "-o", "b", "--forse"}), {"'--force'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"info", "a", "--jsn"}), {"'--json'"}));
  EXPECT_TRUE(wrong_usage(graspmap({"evaluate", "a", "-o", "b", "--sead", "1"}), {"'--seed'"}));
  EXPECT_TRUE(
      wrong_usage(graspmap({"convert", "a", "-o", "b", "--encodin", "ascii"}), {"'--encoding'"}));
}

TEST(CommandLine, MissingAndSurplusArguments) {
  EXPECT_TRUE(wrong_usage(graspmap({"score", "t.pcd"}), {"--output"}));
  EXPECT_TRUE(wrong_usage(graspmap({"score", "-o", "m.pcd"}), {"TERRAIN"}));
  EXPECT_TRUE(wrong_usage(graspmap({"texture", "m.ply", "-o", "m.glb"}), {"--scan"}));
  EXPECT_TRUE(wrong_usage(graspmap({"convert", "s.db"}), {"-o", "--bundler", "--colmap"}));
  EXPECT_TRUE(wrong_usage(graspmap({"score", "a", "b", "-o", "m.pcd"}), {": b"}));
  EXPECT_TRUE(wrong_usage(graspmap({"score", "a", "-o", "m.pcd", "--method"}), {"--method"}));
  EXPECT_TRUE(wrong_usage(graspmap({"convert", "a"}), {"--output"}));
  EXPECT_TRUE(wrong_usage(graspmap({"lookup", "a", "-o", "b"}), {"POINTS"}));
  EXPECT_TRUE(graspmap_test::names_in_scratch().empty());
}

TEST(CommandLine, DataGoToStdoutAndLogsToStderr) {
  graspmap_test::write_terrain();
  const ProgramResult result = score_quickly({});
  EXPECT_TRUE(succeeded(result));
  EXPECT_EQ(result.standard_output, "");
  EXPECT_NE(result.standard_error, "");
  const ProgramResult quiet = score_quickly({"--quiet"});
  EXPECT_TRUE(succeeded(quiet));
  EXPECT_EQ(quiet.standard_error, "");
  const ProgramResult verbose = score_quickly({"--verbose"});
  EXPECT_GT(verbose.standard_error.size(), result.standard_error.size());
}

TEST(CommandLine, ProgressAsJsonLines) {
  graspmap_test::write_terrain();
  const ProgramResult result = score_quickly({"--quiet", "--progress", "json"});
  EXPECT_EQ(result.standard_error, "") << "--quiet is stronger";
  const ProgramResult told = score_quickly({"--progress", "json", "--tile-size", "0.1"});
  std::size_t lines = 0;
  std::istringstream text(told.standard_error);
  for (std::string line; std::getline(text, line);) {
    if (!line.starts_with("{")) continue;
    const auto json = nlohmann::json::parse(line);
    EXPECT_LE(json.at("done"), json.at("total"));
    ++lines;
  }
  EXPECT_GT(lines, 2U) << told.standard_error;
}

TEST(CommandLine, PrintedParametersFedBackGiveTheSame) {
  graspmap_test::write_terrain();
  const Words flags = {"--method", "thesis", "--voxel-size", "0.012", "--extra-void-layers", "3",
                       "--up",     "0,0,1",  "--frame",      "input", "--interpolation"};
  Words asking = {"score", "--print-config",
                  "--set", "gripper.opening_angle_deg=70",
                  "--set", "gripper.opening_angle_deg=80"};
  asking.insert(asking.end(), flags.begin(), flags.end());
  const ProgramResult printed = graspmap(asking);
  ASSERT_TRUE(succeeded(printed));
  write_text(scratch("printed.yaml"), printed.standard_output);
  const ProgramResult again = graspmap({"score", "--print-config", "--config", "printed.yaml"});
  EXPECT_EQ(again.standard_output, printed.standard_output);
  Words by_flags = {"--set", "gripper.opening_angle_deg=80"};
  by_flags.insert(by_flags.end(), flags.begin(), flags.end());
  ASSERT_TRUE(succeeded(score_quickly(by_flags)));
  const std::string map = content("map.csv");
  ASSERT_TRUE(succeeded(score_quickly({"--config", "printed.yaml"})));
  EXPECT_EQ(content("map.csv"), map);
  EXPECT_NE(printed.standard_output.find("method: thesis"), std::string::npos);
}

TEST(CommandLine, FlagsAreStrongerThanTheConfiguration) {
  write_text(scratch("s.yaml"), "voxel_size_m: 0.02\nextra_void_layers: 4\n");
  const std::string printed = graspmap({"score", "--print-config", "--config", "s.yaml",
                                        "--voxel-size", "0.03", "--set", "tile_size_m=2"})
                                  .standard_output;
  for (const char* part : {"voxel_size_m: 0.03 ", "extra_void_layers: 4 ", "tile_size_m: 2 ",
                           "solid_voxel_threshold: 120 "})
    EXPECT_NE(printed.find(part), std::string::npos) << part << "\n" << printed;
}

TEST(CommandLine, ScenariosOfTheToolkitAreFoundByName) {
  const std::filesystem::path folder = graspmap_test::source_folder() / "data" / "scenarios";
  std::size_t scenarios = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".yaml") continue;
    ++scenarios;
    EXPECT_TRUE(
        succeeded(graspmap({"score", "--print-config", "--config", entry.path().stem().string()})))
        << entry.path();
  }
  EXPECT_EQ(scenarios, 6U);
}

TEST(CommandLine, DryRunWritesNothing) {
  graspmap_test::write_terrain();
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(succeeded(score_quickly({"--dry-run"})));
  EXPECT_TRUE(succeeded(graspmap({"convert", "terrain.pcd", "-o", "terrain.ply", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
  EXPECT_TRUE(bad_input(score_quickly({"--dry-run", "--voxel-size", "10"}),
                        {.field = "voxel_size_m", .value = "10"}))
      << "it checks all the same";
  EXPECT_TRUE(
      bad_input(graspmap({"score", "none.pcd", "-o", "m.csv", "--dry-run"}), {.file = "none.pcd"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

TEST(CommandLine, ForeignOutputIsOverwrittenByForceAlone) {
  graspmap_test::write_terrain();
  write_text(scratch("map.csv"), "precious");
  EXPECT_TRUE(bad_input(score_quickly({}), {.file = "map.csv", .about = "--force"}));
  EXPECT_TRUE(bad_input(score_quickly({"--dry-run"}), {.file = "map.csv", .about = "--force"}));
  EXPECT_EQ(content("map.csv"), "precious");
  EXPECT_TRUE(succeeded(score_quickly({"--force"})));
  EXPECT_NE(content("map.csv"), "precious");
  EXPECT_TRUE(succeeded(score_quickly({}))) << "now it is graspmap's own";
}

TEST(CommandLine, ForeignFileInThePlaceOfTheManifestIsKept) {
  graspmap_test::write_terrain();
  write_text(scratch("map.csv.json"), "{\"mine\": 1}");
  EXPECT_TRUE(bad_input(score_quickly({}), {.file = "map.csv.json", .about = "--force"}));
  EXPECT_EQ(content("map.csv.json"), "{\"mine\": 1}");
  EXPECT_TRUE(succeeded(score_quickly({"--force"})));
}

TEST(CommandLine, FailedRunKeepsTheEarlierOutput) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(score_quickly({})));
  const std::string map = content("map.csv");
  const std::string manifest = content("map.csv.json");
  EXPECT_TRUE(
      bad_input(score_quickly({"--voxel-size", "10"}), {.field = "voxel_size_m", .value = "10"}));
  EXPECT_EQ(content("map.csv"), map);
  EXPECT_EQ(content("map.csv.json"), manifest);
}

// `graspmap WORDS` in a shell that has run `before`.
ProgramResult in_shell(const std::string& before, const std::string& words) {
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
  return graspmap_test::run_program({"/bin/sh", "-c", before + "\"$0\" " + words, program},
                                    {.folder = scratch("")});
}

TEST(CommandLine, AFileThatGrowsBeyondItsLimitIsAnError) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(score_quickly({})));
  const std::string map = content("map.csv");
  const auto names = graspmap_test::names_in_scratch();
  const ProgramResult result =
      in_shell("ulimit -f 8; ", "score terrain.pcd --curvature-radius 0 -o map.csv --quiet");
  EXPECT_TRUE(ended_with(result, {.file = "map.csv", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(content("map.csv"), map);
  EXPECT_EQ(graspmap_test::names_in_scratch(), names);
}

TEST(CommandLine, AFileOfAFolderThatGrowsBeyondItsLimitIsNamed) {
  const ProgramResult result =
      in_shell("ulimit -f 512; ",
               "simulate terrain --size 1.5 --tile-size 1.5 --spacing 0.008 -o pieces --quiet");
  EXPECT_TRUE(
      ended_with(result, {.file = "pieces/piece_0_0.pcd", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{});
}

TEST(CommandLine, AFolderThatCannotBeMadeIsAnError) {
  write_text(scratch("t.csv"), "graspable,score\n1,0.9\n0,0.2\n");
  const ProgramResult result = graspmap({"evaluate", "t.csv", "-o", "t.csv/inner/out"});
  EXPECT_TRUE(ended_with(result, {.file = "t.csv/inner", .kind = libmap::ErrorKind::failed}));
}

TEST(CommandLine, WhatStandsInAFileReachesTheTerminalAsPlainText) {
  write_text(scratch("a.csv"), "x,y,z\n\x1b[2J\xff\r\xc3\xa9\xc2\x9b,0,0\n");
  EXPECT_TRUE(bad_input(graspmap({"lookup", "a.csv", "a.csv", "-o", "b.csv"}),
                        {.file = "a.csv",
                         .field = "row 1, column 'x'",
                         .value = "'\\x1b[2J\\xff\\x0d\xc3\xa9\\xc2\\x9b'"}));
  write_text(scratch("b.csv"), "x,y,z\n" + std::string(100'000, 'n') + ",0,0\n");
  const graspmap_test::ProgramResult result = graspmap({"lookup", "b.csv", "b.csv", "-o", "c.csv"});
  EXPECT_TRUE(bad_input(result, {.file = "b.csv", .field = "row 1, column 'x'"}));
  EXPECT_LT(result.standard_error.size(), 1100U);
}

TEST(CommandLine, FaultsOfTheConfigurationNameItsFile) {
  graspmap_test::write_terrain();
  write_text(scratch("s.yaml"), "gripper: scare\n");
  EXPECT_TRUE(bad_input(graspmap({"score", "terrain.pcd", "--config", "s.yaml", "-o", "a.pcd"}),
                        {.file = "s.yaml", .field = "gripper", .value = "scare"}));
  EXPECT_TRUE(bad_input(
      graspmap({"score", "terrain.pcd", "--config", "s.yaml", "--gripper", "scarf", "-o", "a.pcd"}),
      {.field = "gripper", .value = "scarf"}));
}

TEST(CommandLine, PathsThatLeadNowhere) {
  std::filesystem::create_symlink("loop.pcd", scratch("loop.pcd"));
  EXPECT_TRUE(bad_input(graspmap({"convert", "loop.pcd", "-o", "a.ply"}), {.file = "loop.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", std::string(300, 'n') + ".pcd", "-o", "a.ply"}),
                        {.file = std::string(300, 'n') + ".pcd"}));
}

TEST(CommandLine, WhatCannotBePrintedIsAnError) {
  graspmap_test::write_terrain();
  for (const auto& [words, program] : {std::pair{"info terrain.pcd", "graspmap info"},
                                       {"score --print-config", "graspmap score"},
                                       {"score --help", "graspmap score"},
                                       {"simulate --help", "graspmap simulate"},
                                       {"--help", "graspmap"},
                                       {"--version", "graspmap"}}) {
    const ProgramResult result = in_shell("", std::string(words) + " > /dev/full");
    EXPECT_TRUE(ended_with(result, {.file = "standard output", .kind = libmap::ErrorKind::failed}));
    EXPECT_TRUE(result.standard_error.starts_with(std::string(program) + ": error: "));
  }
}

TEST(CommandLine, ManifestSaysWhatMadeTheMap) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(score_quickly({"--set", "gripper.opening_angle_deg=80"})));
  const nlohmann::json json = graspmap_test::json_of("map.csv.json");
  EXPECT_EQ(json.at("command"), "score");
  EXPECT_EQ(json.at("inputs").at(0).at("path"), "terrain.pcd");
  EXPECT_EQ(json.at("inputs").at(0).at("sha256"), libmap::sha256_of_file(scratch("terrain.pcd")));
  EXPECT_EQ(json.at("inputs").at(0).at("bytes"),
            std::filesystem::file_size(scratch("terrain.pcd")));
  const auto gripper = graspmap_test::source_folder() / "data" / "grippers" / "scar-e.yaml";
  EXPECT_EQ(json.at("inputs").at(1).at("sha256"), libmap::sha256_of_file(gripper));
  EXPECT_EQ(json.at("parameters").at("gripper.opening_angle_deg"), "80");
  EXPECT_EQ(json.at("parameters").at("voxel_size_m"), 0.01);
  EXPECT_EQ(json.at("parameters").at("curvature_radius_m"), 0.0);
  EXPECT_EQ(json.at("frame"), "terrain");
  EXPECT_EQ(json.at("transforms").at("terrain_from_input").size(), 12U);
  EXPECT_EQ(json.at("results").at("input_points"), 14400);
  EXPECT_GT(json.at("results").at("scored_voxels"), 1000);
  EXPECT_TRUE(json.at("run").at("timings_s").contains("voxel matching"));
}

TEST(CommandLine, ManifestIsTheSameForEachRunButForTheRun) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(score_quickly({"--threads", "1"})));
  nlohmann::json first = graspmap_test::json_of("map.csv.json");
  ASSERT_TRUE(succeeded(score_quickly({"--threads", "2"})));
  nlohmann::json second = graspmap_test::json_of("map.csv.json");
  EXPECT_EQ(first.at("run").at("threads"), 1);
  EXPECT_EQ(second.at("run").at("threads"), 2);
  first.erase("run");
  second.erase("run");
  EXPECT_EQ(first, second);
}

TEST(CommandLine, ForeignLocaleChangesNothing) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(score_quickly({})));
  const std::string map = content("map.csv");
  for (const char* locale : {"de_DE.UTF-8", "tr_TR.UTF-8", "C.UTF-8"}) {
    ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0",
                                    "--voxel-size", "0.01", "-o", "map.csv"},
                                   {{"LC_ALL", locale}, {"LANG", locale}})));
    EXPECT_EQ(content("map.csv"), map) << locale;
  }
}

}  // namespace command_line_test
