#include "libgtd/scenario_io.h"

#include "libgtd/score/scenario.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/parameters.h"

namespace libgtd {

DetectionOptions read_scenario(const std::string& name) {
  constexpr std::size_t max_bytes = std::size_t{1} << 24;
  const std::filesystem::path file = libmap::find_data_file("scenarios", name);
  DetectionOptions options;
  libmap::ParameterTable table;
  bind(table, options.scenario);
  libmap::set_from_yaml(table, libmap::read_whole_file(file, max_bytes), file.string());
  libmap::in_file(file, [&] { options.scenario.check(); });
  options.gripper = gripper_of(options);
  return options;
}

}  // namespace libgtd
