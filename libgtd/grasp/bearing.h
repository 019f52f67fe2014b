// What a contact of the gripper can bear: the forces that its spines take, by one of two published
// laws of engagement.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/gripper_closing.h"
#include "libgtd/gripper/gripper.h"
#include "libmap/core/parameters.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

// asperities: as the section `engagement` of the gripper says. adhesion: a
// finger bears a tension T along its drag up to a limit, and in proportion to T lateral force and
// pull-off (LORIS).
enum class EngagementLaw { asperities, adhesion };
const std::vector<std::pair<std::string, EngagementLaw>>& engagement_law_names();

struct EngagementOptions {
  EngagementLaw law = EngagementLaw::asperities;
  double adhesion_limit_n = 20.0;      // T of all fingers of the gripper
  double adhesion_lateral_deg = 45.0;  // lateral force: at most T tan of it
  double adhesion_pull_deg = 20.0;     // pull-off: at most T tan of it
};
void bind(libmap::ParameterTable& table, EngagementOptions& options);

// How the spines of a contact share its force. best: as is best for each. equally: in equal parts;
// a spine that slips drops out, and those on steeper facets take over its part.
enum class SpineSharing { best, equally };

// A contact's forces on the gripper are a convex set that holds 0. A spine sits in the corner
// between the ground and its facet; it bears what both bear, each at most `limit_n` and in a
// pyramid of eight edges inside Coulomb's cone, exact in the plane of normal and drag. Forces in N.
class BearingContact {
 public:
  // Asperities: `leans_rad` are the psi of the spines that meet a facet; a link has one of 0.
  BearingContact(const GripContact& contact, std::vector<double> leans_rad, double friction,
                 double limit_n);
  // Adhesion: `limit_n` of this finger.
  BearingContact(const GripContact& contact, const EngagementOptions& options, double friction,
                 double limit_n);

  const Eigen::Vector3d& point() const { return point_; }      // m
  const Eigen::Vector3d& normal() const { return normal_; }    // out of the ground
  const Eigen::Vector3d& outward() const { return outward_; }  // away from the palm's axis
  std::size_t finger() const { return finger_; }
  bool is_link() const { return is_link_; }
  std::size_t spines() const { return spines_; }

  // A force of the set with the largest product with `worth`.
  Eigen::Vector3d best_force(const Eigen::Vector3d& worth, SpineSharing sharing) const {
    return best_local_force(frame().transpose() * worth, sharing);
  }
  // The columns are normal, drag and lateral.
  Eigen::Matrix3d frame() const {
    Eigen::Matrix3d frame;
    frame << normal_, drag_, lateral_;
    return frame;
  }
  // The largest product, and a force that has it, of a worth's products with the columns of
  // `frame`.
  double max_local_product(const Eigen::Vector3d& local, SpineSharing sharing) const;
  Eigen::Vector3d best_local_force(const Eigen::Vector3d& local, SpineSharing sharing) const;
  // For pictures: the edges of the forces on the steepest facet (adhesion: of all forces), unit
  // vectors in turn about it.
  std::vector<Eigen::Vector3d> cone() const;

 private:
  struct Edge;
  Edge best_edge(double cosine, double sine, const Eigen::Vector3d& local) const;

  Eigen::Vector3d point_;
  Eigen::Vector3d normal_;
  Eigen::Vector3d drag_;
  Eigen::Vector3d lateral_;
  Eigen::Vector3d outward_;
  std::size_t finger_ = 0;
  bool is_link_ = false;
  double friction_ = 0.0;
  double slant_ = 1.0;  // cosine of the friction's angle
  double limit_n_ = 0.0;
  std::size_t spines_ = 0;
  std::vector<double> cosines_;  // of the leans, the largest lean first; padded with 0
  std::vector<double> sines_;
  std::vector<double> counts_;             // of the leans up to each; padded with 0
  std::vector<Eigen::Vector3d> adhesion_;  // edges for `limit_n_`; not empty: the law is adhesion
};

// The contacts of a closed gripper with spines drawn at random. Contacts on which no spine engages
// are left out. Law `adhesion` draws nothing.
std::vector<BearingContact> draw_bearing(const std::vector<GripContact>& contacts,
                                         const Gripper& gripper, const EngagementOptions& options,
                                         libmap::RandomStream& random);

}  // namespace libgtd
