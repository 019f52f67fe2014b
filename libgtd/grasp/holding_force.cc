#include "libgtd/grasp/holding_force.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libgtd/grasp/cloned_loops.h"
#include "libmap/core/angle.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

namespace {

// Moments are divided by this length, so that all rows are forces of one size.
constexpr double wrench_length_m = 0.1;

double small_value(Eigen::Index row) {
  return 1e-10 * (1.0 + libmap::unit_noise(static_cast<std::uint64_t>(row), 7));
}

// result = matrix * vector, of which many entries are 0
GRASPMAP_CLONED void multiply(const double* matrix, const double* vector, double* result,
                              std::ptrdiff_t size) {
  for (std::ptrdiff_t row = 0; row < size; ++row) result[row] = 0.0;
  for (std::ptrdiff_t n = 0; n < size; ++n) {
    if (vector[n] == 0.0) continue;
    for (std::ptrdiff_t row = 0; row < size; ++row)
      result[row] += vector[n] * matrix[n * size + row];
  }
}

// Of each column of a square matrix: its entry in the row `leaving` divided by the pivot, and
// `change` times that subtracted from the other entries; change[leaving] is 0.
GRASPMAP_CLONED void exchange(double* matrix, const double* change, double pivot,
                              std::ptrdiff_t leaving, std::ptrdiff_t size) {
  for (std::ptrdiff_t n = 0; n < size; ++n) {
    double* column = matrix + n * size;
    if (column[leaving] == 0.0) continue;
    const double share = column[leaving] / pivot;
    column[leaving] = share;
    for (std::ptrdiff_t row = 0; row < size; ++row) column[row] -= share * change[row];
  }
}

// The primal simplex method (Dantzig 1963) with the inverse of the basis. A contact's force is a
// combination of vertices of its set, weights up to 1 in sum; a vertex is made only when it is the
// best one to enter (Dantzig and Wolfe 1960). Rows: six of the equilibrium, one for each contact,
// one for each finger's drive. On the right 0 for the equilibrium, else 1.
class EquilibriumProgram {
 public:
  EquilibriumProgram(const std::vector<BearingContact>& contacts, const HoldingOptions& options)
      : contacts_(contacts), options_(options) {
    std::size_t fingers = 0;
    for (const BearingContact& contact : contacts) {
      arms_.push_back(contact.point() - options.load_point);
      fingers = std::max(fingers, contact.finger() + 1);
    }
    std::vector<bool> has_contact(fingers, false);
    for (const BearingContact& contact : contacts) has_contact[contact.finger()] = true;
    fingers_ = std::count(has_contact.begin(), has_contact.end(), true);
    rows_ = static_cast<Eigen::Index>(6 + contacts.size() + fingers);
    inverse_.setIdentity(rows_, rows_);
    values_.setZero(rows_);
    values_.tail(rows_ - 6).setOnes();
    column_.setZero(rows_);
    change_.setZero(rows_);
    prices_.setZero(rows_);
    kinds_.assign(static_cast<std::size_t>(rows_), Kind::slack);
    std::fill_n(kinds_.begin(), 6, Kind::artificial);
  }

  // The basis of the direction before, if any, is the start: first the new pull takes the place of
  // the former one, as part of the same program.
  double max_pull(const Eigen::Vector3d& direction, double enough) {
    if (const Eigen::Index former = row_of(Kind::pull); former >= 0)
      kinds_[static_cast<std::size_t>(former)] = Kind::former_pull;
    direction_ = direction;
    make_pull();
    if (!enter(Kind::pull)) return 0.0;
    // What the former pull costs, relative to the new one: a small cost leads to it on the way.
    double cost = 0.1;
    constexpr double max_cost = 1e9;
    constexpr double negligible_n = 1e-9;
    constexpr int max_pivots = 2000;
    for (int pivot = 0; pivot < max_pivots && cost < max_cost; ++pivot) {
      const Eigen::Index pull = row_of(Kind::pull);
      const Eigen::Index former = row_of(Kind::former_pull);
      const bool is_former_gone = former < 0 || true_value(former) <= negligible_n;
      if (is_former_gone && pull >= 0 && values_[pull] >= enough && true_value(pull) >= enough)
        break;
      prices_.setZero(rows_);
      if (pull >= 0) prices_ += inverse_.row(pull);
      if (former >= 0) prices_ -= cost * inverse_.row(former);
      const double gain = price(pull < 0);
      if (gain > 1e-11 * (1.0 + (pull < 0 ? 0.0 : std::abs(values_[pull])))) {
        if (!enter(entering_)) break;
      } else if (is_former_gone) {
        break;
      } else {
        cost *= 100.0;
      }
    }
    const Eigen::Index pull = row_of(Kind::pull);
    return pull < 0 ? 0.0 : std::max(0.0, true_value(pull));
  }

 private:
  enum class Kind : std::uint8_t { slack, artificial, pull, former_pull, contact };

  Eigen::Index drive_row(const BearingContact& contact) const {
    return 6 + static_cast<Eigen::Index>(contacts_.size() + contact.finger());
  }
  // Of a rigid finger: c_k / m.
  double reaction_of(const BearingContact& contact) const {
    const double sine = contact.normal().dot(contact.outward());
    const double cosine = contact.normal().dot(options_.axis);
    return std::max(0.0, sine * cosine) / (1.0 + sine * sine) / static_cast<double>(fingers_);
  }
  Eigen::Index row_of(Kind kind) const {
    const auto found = std::find(kinds_.begin(), kinds_.end(), kind);
    return found == kinds_.end() ? -1 : found - kinds_.begin();
  }
  void make_pull() {
    column_.setZero();
    column_.head<3>() = direction_;
    if (!options_.holds_when_closed) return;
    for (const BearingContact& contact : contacts_) {
      double& share = column_[drive_row(contact)];
      share = std::min(share, -reaction_of(contact) / options_.closing_force_n);
    }
  }
  // Of a basic variable, without the perturbation.
  double true_value(Eigen::Index row) const { return inverse_.row(row).tail(rows_ - 6).sum(); }

  // Makes the column with the largest gain, which it returns.
  double price(bool with_pull) {
    const Eigen::RowVectorXd& prices = prices_;
    const Eigen::Vector3d force_price = prices.head<3>();
    const Eigen::Vector3d moment_price = prices.segment<3>(3) / wrench_length_m;
    const auto worth_of = [&](std::size_t n) -> Eigen::Vector3d {
      return -force_price - moment_price.cross(arms_[n]) -
             prices[drive_row(contacts_[n])] / options_.closing_force_n * contacts_[n].outward();
    };
    double most = 0.0;
    std::size_t best = contacts_.size();
    for (std::size_t n = 0; n < contacts_.size(); ++n) {
      const double gain = contacts_[n].max_product(worth_of(n), options_.sharing) -
                          prices[6 + static_cast<Eigen::Index>(n)];
      if (gain <= most) continue;
      most = gain;
      best = n;
    }
    Eigen::Index slack = -1;
    for (Eigen::Index row = 6; row < rows_; ++row) {
      if (-prices[row] <= most) continue;
      most = -prices[row];
      slack = row;
    }
    column_.setZero();
    entering_ = slack >= 0 ? Kind::slack : Kind::contact;
    if (slack >= 0) {
      column_[slack] = 1.0;
    } else if (best < contacts_.size()) {
      const Eigen::Vector3d force = contacts_[best].best_force(worth_of(best), options_.sharing);
      column_.head<3>() = force;
      column_.segment<3>(3) = arms_[best].cross(force) / wrench_length_m;
      column_[6 + static_cast<Eigen::Index>(best)] = 1.0;
      column_[drive_row(contacts_[best])] =
          contacts_[best].outward().dot(force) / options_.closing_force_n;
    }
    if (!with_pull) return most;
    const Eigen::VectorXd other = column_;
    make_pull();
    const double gain = 1.0 - prices_.dot(column_);
    if (gain > most) {
      entering_ = Kind::pull;
      return gain;
    }
    column_ = other;
    return most;
  }

  // Lets `column_` enter the basis; false if nothing bounds it.
  bool enter(Kind kind) {
    multiply(inverse_.data(), column_.data(), change_.data(), rows_);
    Eigen::Index leaving = -1;
    // Smaller changes are rounding errors; dividing by one would spoil the inverse.
    const double smallest = 1e-9 * change_.cwiseAbs().maxCoeff();
    // Artificial variables are 0 and must stay so: they leave as soon as they would change.
    double largest = smallest;
    for (Eigen::Index row = 0; row < rows_; ++row)
      if (kinds_[static_cast<std::size_t>(row)] == Kind::artificial &&
          std::abs(change_[row]) > largest) {
        largest = std::abs(change_[row]);
        leaving = row;
      }
    double step = 0.0;
    if (leaving < 0) {
      perturb();
      step = std::numeric_limits<double>::infinity();
      for (Eigen::Index row = 0; row < rows_; ++row) {
        if (kinds_[static_cast<std::size_t>(row)] == Kind::artificial || change_[row] <= smallest)
          continue;
        const double bound = values_[row] / change_[row];
        if (bound >= step) continue;
        step = bound;
        leaving = row;
      }
      if (leaving < 0) return false;
    }
    values_ -= step * change_;
    values_[leaving] = step > 0.0 || !is_perturbed_ ? step : small_value(leaving);
    const double pivot = change_[leaving];
    change_[leaving] = 0.0;
    exchange(inverse_.data(), change_.data(), pivot, leaving, rows_);
    kinds_[static_cast<std::size_t>(leaving)] = kind;
    return true;
  }

  // Many basic variables are 0 at first. Small different values instead keep the method from going
  // round in circles; results are computed without them.
  void perturb() {
    if (is_perturbed_) return;
    is_perturbed_ = true;
    for (Eigen::Index row = 0; row < rows_; ++row)
      if (kinds_[static_cast<std::size_t>(row)] != Kind::artificial)
        values_[row] += small_value(row);
  }

  const std::vector<BearingContact>& contacts_;
  const HoldingOptions& options_;
  std::vector<Eigen::Vector3d> arms_;
  std::ptrdiff_t fingers_ = 0;  // with contacts
  Eigen::Index rows_ = 0;
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd values_;
  Eigen::Vector3d direction_;  // of the pull
  Eigen::VectorXd column_;     // that enters
  Eigen::VectorXd change_;     // of the values by it
  Eigen::RowVectorXd prices_;  // of the rows: how much the pull grows with their right side
  std::vector<Kind> kinds_;
  Kind entering_ = Kind::slack;
  bool is_perturbed_ = false;
};

}  // namespace

double holding_force(const std::vector<BearingContact>& contacts, const Eigen::Vector3d& direction,
                     const HoldingOptions& options, double enough) {
  if (contacts.size() < 2) return 0.0;  // one point balances no pull beside it
  return EquilibriumProgram(contacts, options).max_pull(direction, enough);
}

LeastForce least_holding_force(const std::vector<BearingContact>& contacts,
                               const HoldingOptions& options, std::size_t first) {
  if (contacts.size() < 2) return {0.0, first};
  const std::vector<PullDirection>& directions = pull_directions();
  EquilibriumProgram program(contacts, options);
  constexpr double all = std::numeric_limits<double>::infinity();
  LeastForce least{program.max_pull(directions[first].vector, all), first};
  for (std::size_t n = 0; n < directions.size() && least.force_n > 0.0; ++n) {
    if (n == first) continue;
    const double force = program.max_pull(directions[n].vector, least.force_n);
    if (force < least.force_n) least = {force, n};
  }
  return least;
}

std::string PullDirection::name() const {
  return tilt_deg == 0 ? "away" : std::to_string(tilt_deg) + "@" + std::to_string(azimuth_deg);
}

const std::vector<PullDirection>& pull_directions() {
  static const std::vector<PullDirection> directions = [] {
    std::vector<PullDirection> made = {{0, 0, Eigen::Vector3d::UnitZ()}};
    for (const int tilt : {45, 90})
      for (int azimuth = 0; azimuth < 360; azimuth += 45) {
        const double t = tilt * libmap::radians_per_degree;
        const double a = azimuth * libmap::radians_per_degree;
        made.push_back(
            {tilt, azimuth, {std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)}});
      }
    return made;
  }();
  return directions;
}

}  // namespace libgtd
