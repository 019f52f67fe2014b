// Forces that each contact of a closed gripper can bear, by one of two laws of spine engagement.
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

// asperities: each spine engages with a random facet, by the section `engagement` of the gripper
// file. adhesion: a finger bears a tension T in drag direction (GripContact) up to a limit, and
// lateral and pull-off forces up to a fraction of T, as in the model of the LORIS gripper.
enum class EngagementLaw { asperities, adhesion };
const std::vector<std::pair<std::string, EngagementLaw>>& engagement_law_names();

struct EngagementOptions {
  EngagementLaw law = EngagementLaw::asperities;
  double adhesion_limit_n = 20.0;      // N; maximum of T, summed over all fingers
  double adhesion_lateral_deg = 45.0;  // maximum lateral force: T tan(adhesion_lateral_deg)
  double adhesion_pull_deg = 20.0;     // maximum pull-off: T tan(adhesion_pull_deg)
};
void bind(libmap::ParameterTable& table, EngagementOptions& options);

// Distribution of a contact's force over the spines of the contact. best: the distribution with the
// largest force. equally: equal parts; spines on flatter facets may slip and then bear nothing.
enum class SpineSharing { best, equally };

// Convex set of forces that a contact can exert on the gripper; it contains the zero force. A spine
// touches both the ground and a facet. Its force is the sum of a force from the ground plane and a
// force from the facet, both at most `limit_n` and inside a pyramid with eight edges that
// approximates Coulomb's friction cone. Forces in N; vectors in the frame of the ground patch.
class BearingContact {
 public:
  // Law `asperities`: `facet_angles_rad` are the inclinations of the facets, one per engaged spine;
  // {0} for a contact of a link. `limit_n` is the limit of one spine, or of the link.
  BearingContact(const GripContact& contact, std::vector<double> facet_angles_rad, double friction,
                 double limit_n);
  // Law `adhesion`: `limit_n` is the maximum of T for this finger.
  BearingContact(const GripContact& contact, const EngagementOptions& options, double friction,
                 double limit_n);

  const Eigen::Vector3d& point() const { return point_; }      // m
  const Eigen::Vector3d& normal() const { return normal_; }    // out of the ground
  const Eigen::Vector3d& outward() const { return outward_; }  // away from the palm's axis
  std::size_t finger() const { return finger_; }
  bool is_link() const { return is_link_; }
  std::size_t spines() const { return spines_; }  // engaged spines; link: 1, adhesion: 0

  // Returns the force of the set that has the maximum scalar product with `objective`, N.
  Eigen::Vector3d best_force(const Eigen::Vector3d& objective, SpineSharing sharing) const {
    return best_local_force(frame().transpose() * objective, sharing);
  }
  // Returns the contact frame; the columns are normal, drag and lateral direction.
  Eigen::Matrix3d frame() const {
    Eigen::Matrix3d frame;
    frame << normal_, drag_, lateral_;
    return frame;
  }
  // Return the maximum scalar product of a force of the set with `local`, a vector in the contact
  // frame (frame()), and the force with this product, in the frame of the patch.
  double max_local_product(const Eigen::Vector3d& local, SpineSharing sharing) const;
  Eigen::Vector3d best_local_force(const Eigen::Vector3d& local, SpineSharing sharing) const;
  // Returns the edges of the cone of forces of the steepest facet (law adhesion: of the finger), as
  // unit vectors in order around the cone, for images.
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
  double cos_friction_angle_ = 1.0;  // cosine of the friction angle
  double limit_n_ = 0.0;
  std::size_t spines_ = 0;
  std::vector<double> cosines_;  // of the facet angles, which descend; padded with 0
  std::vector<double> sines_;
  std::vector<double> counts_;             // number of facet angles up to each; padded with 0
  std::vector<Eigen::Vector3d> adhesion_;  // edges for `limit_n_`; empty for asperities
};

// Draws at random which spines of a closed gripper's contacts engage, and with which facets. Skips
// spine contacts of which no spine engages. Law adhesion is not random. `gripper` needs `fingers`.
std::vector<BearingContact> draw_bearing(const std::vector<GripContact>& contacts,
                                         const Gripper& gripper, const EngagementOptions& options,
                                         libmap::RandomStream& random);

}  // namespace libgtd
