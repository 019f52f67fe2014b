#include <mujoco/mujoco.h>

#include <algorithm>
#include <span>
#include <stdexcept>
#include <string>

#include "libmap/core/file_output.h"
#include "tests/libmap/world/falling_balls.h"

namespace graspmap_test {

namespace {

constexpr std::size_t balls_at_once = 4;
constexpr double mujoco_fall_s = 1.5;

// Friction against sliding and rolling keeps balls where they fall. They do not meet each other.
std::string scene_text() {
  std::string text =
      "<mujoco><include file=\"world.xml\"/><size njmax=\"6000\" "
      "nconmax=\"1000\"/><worldbody>";
  for (std::size_t n = 0; n < balls_at_once; ++n)
    text +=
        "<body><freejoint/><geom size=\"0.01\" contype=\"1\" conaffinity=\"0\" condim=\"6\" "
        "friction=\"3 0.05 0.05\"/></body>";
  return text + "</worldbody></mujoco>";
}

void drop(const mjModel* model, std::span<const Eigen::Vector3d> places, FallenBalls& balls) {
  mjData* data = mj_makeData(model);
  for (std::size_t n = 0; n < balls_at_once; ++n) {
    // Balls without a place of their own fall beside the world.
    const Eigen::Vector3d place =
        n < places.size() ? places[n] : Eigen::Vector3d(1e3 + static_cast<double>(n), 0, 0);
    std::copy_n(place.data(), 3, data->qpos + 7 * n);
  }
  while (data->time < mujoco_fall_s) mj_step(model, data);
  const int first = model->nbody - static_cast<int>(balls_at_once);
  for (std::size_t n = 0; n < places.size(); ++n) {
    const mjtNum* at = data->xpos + 3 * (static_cast<std::size_t>(first) + n);
    balls.centers.emplace_back(at[0], at[1], at[2]);
    const mjtNum* speed = data->qvel + 6 * n;
    balls.speeds.push_back(Eigen::Vector3d(speed[0], speed[1], speed[2]).norm());
  }
  for (int n = 0; n < data->ncon; ++n)
    balls.contacts.emplace_back(data->contact[n].pos[0], data->contact[n].pos[1],
                                data->contact[n].pos[2]);
  mj_deleteData(data);
}

}  // namespace

FallenBalls drop_in_mujoco(const std::filesystem::path& folder,
                           const std::vector<Eigen::Vector3d>& places) {
  const std::filesystem::path file = folder / "balls.xml";
  libmap::write_text(file, scene_text());
  char error[1000] = "";
  mjModel* model = mj_loadXML(file.c_str(), nullptr, error, sizeof(error));
  if (model == nullptr) throw std::runtime_error(error);
  FallenBalls balls;
  const std::span<const Eigen::Vector3d> all(places);
  for (std::size_t n = 0; n < places.size(); n += balls_at_once)
    drop(model, all.subspan(n, std::min(balls_at_once, places.size() - n)), balls);
  mj_deleteModel(model);
  return balls;
}

}  // namespace graspmap_test
