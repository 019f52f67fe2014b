#include <btBulletDynamicsCommon.h>
#include <urdf_parser/urdf_parser.h>

#include <memory>
#include <stdexcept>

#include "libmap/core/file_output.h"
#include "libmap/io/mesh_io.h"
#include "tests/libmap/world/falling_balls.h"

namespace graspmap_test {

namespace {

constexpr double fall_s = 3.0;
constexpr double step_s = 1.0 / 500;

// A file's triangles as a static body.
struct Ground {
  libmap::TriangleMesh mesh;
  btTriangleMesh triangles{true, false};
  std::unique_ptr<btBvhTriangleMeshShape> shape;
  btCollisionObject object;

  explicit Ground(const std::filesystem::path& file) : mesh(libmap::read_mesh(file).mesh) {
    const auto vector = [](const Eigen::Vector3d& v) { return btVector3(v.x(), v.y(), v.z()); };
    for (const libmap::Triangle& t : mesh.triangles)
      triangles.addTriangle(vector(mesh.vertices[t[0]]), vector(mesh.vertices[t[1]]),
                            vector(mesh.vertices[t[2]]));
    shape = std::make_unique<btBvhTriangleMeshShape>(&triangles, true);
    shape->setMargin(0.0);
    object.setCollisionShape(shape.get());
  }
};

std::vector<std::filesystem::path> collision_files(const std::filesystem::path& folder) {
  const auto model = urdf::parseURDF(libmap::read_whole_file(folder / "world.urdf"));
  if (!model) throw std::runtime_error("world.urdf cannot be read");
  std::vector<std::filesystem::path> files;
  for (const auto& [name, link] : model->links_)
    if (link->collision) {
      const auto mesh = std::dynamic_pointer_cast<urdf::Mesh>(link->collision->geometry);
      if (!mesh) throw std::runtime_error(name + " has no mesh");
      files.push_back(folder / mesh->filename);
    }
  return files;
}

}  // namespace

FallenBalls drop_in_bullet(const std::filesystem::path& folder,
                           const std::vector<Eigen::Vector3d>& places) {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(0, 0, -9.81));
  constexpr int ground_group = 1;
  constexpr int ball_group = 2;
  std::vector<std::unique_ptr<Ground>> grounds;
  for (const std::filesystem::path& file : collision_files(folder)) {
    grounds.push_back(std::make_unique<Ground>(file));
    grounds.back()->object.setFriction(1.0);
    grounds.back()->object.setRollingFriction(1.0);
    world.addCollisionObject(&grounds.back()->object, ground_group, ball_group);
  }
  btSphereShape shape(ball_radius_m);
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  for (const Eigen::Vector3d& place : places) {
    constexpr double mass_kg = 0.01;
    btVector3 inertia;
    shape.calculateLocalInertia(mass_kg, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass_kg, nullptr, &shape, inertia);
    info.m_startWorldTransform.setOrigin(btVector3(place.x(), place.y(), place.z()));
    info.m_friction = 3.0;
    info.m_rollingFriction = 0.1;
    info.m_spinningFriction = 0.1;
    info.m_angularDamping = 0.5;
    bodies.push_back(std::make_unique<btRigidBody>(info));
    world.addRigidBody(bodies.back().get(), ball_group, ground_group);
  }
  for (double t = 0; t < fall_s; t += step_s) world.stepSimulation(step_s, 0);
  FallenBalls balls;
  for (int n = 0; n < dispatcher.getNumManifolds(); ++n) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(n);
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      const btVector3& at = manifold.getContactPoint(k).getPositionWorldOnA();
      balls.contacts.emplace_back(at.x(), at.y(), at.z());
    }
  }
  for (const auto& body : bodies) {
    const btVector3& at = body->getWorldTransform().getOrigin();
    balls.centers.emplace_back(at.x(), at.y(), at.z());
    balls.speeds.push_back(body->getLinearVelocity().length());
    world.removeRigidBody(body.get());
  }
  return balls;
}

}  // namespace graspmap_test
