#include "libgtd/grasp/holding_force.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "libgtd/gripper/target_clones.h"
#include "libmap/core/angle.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

namespace {

// Divisor of moments, so that all rows are forces of similar size.
constexpr double wrench_length_m = 0.1;

double small_value(Eigen::Index row) {
  return 1e-10 * (1.0 + libmap::unit_noise(static_cast<std::uint64_t>(row), 7));
}

// Columns are padded to multiples of this number of rows, which a loop processes at once.
constexpr std::ptrdiff_t group = 4;

// result = matrix * vector, for vectors with many zeros
GRASPMAP_CLONED void multiply(const double* matrix, const double* vector, double* result,
                              std::ptrdiff_t size, std::ptrdiff_t stride) {
  for (std::ptrdiff_t row = 0; row < stride; ++row) result[row] = 0.0;
  for (std::ptrdiff_t n = 0; n < size; ++n) {
    if (vector[n] == 0.0) continue;
    const double* column = matrix + n * stride;
    for (std::ptrdiff_t row = 0; row < stride; row += group)
      for (std::ptrdiff_t lane = 0; lane < group; ++lane)
        result[row + lane] += vector[n] * column[row + lane];
  }
}

// For each column of a square matrix, divides its entry in the row `leaving` by the pivot and
// subtracts `change` times this entry from the others; change[leaving] must be 0.
GRASPMAP_CLONED void exchange(double* matrix, const double* change, double pivot,
                              std::ptrdiff_t leaving, std::ptrdiff_t size, std::ptrdiff_t stride) {
  for (std::ptrdiff_t n = 0; n < size; ++n) {
    double* column = matrix + n * stride;
    if (column[leaving] == 0.0) continue;
    const double fraction = column[leaving] / pivot;
    column[leaving] = fraction;
    for (std::ptrdiff_t row = 0; row < stride; row += group)
      for (std::ptrdiff_t lane = 0; lane < group; ++lane)
        column[row + lane] -= fraction * change[row + lane];
  }
}

// Step after which each value is 0; infinite for values that do not decrease.
GRASPMAP_CLONED_CHOICE void find_bounds(const double* values, const double* change,
                                        const double* smallest, double* bounds,
                                        std::ptrdiff_t stride) {
  for (std::ptrdiff_t row = 0; row < stride; row += group)
    for (std::ptrdiff_t lane = row; lane < row + group; ++lane) {
      const double bound = values[lane] / change[lane];
      bounds[lane] =
          change[lane] > smallest[lane] ? bound : std::numeric_limits<double>::infinity();
    }
}

// Primal simplex method (Dantzig 1963) with the inverse of the basis. The force of a contact is a
// combination of vertices of its set with weights of sum at most 1; a vertex is created only when
// it is the best to enter (Dantzig and Wolfe 1960). Rows: six of the equilibrium, one per contact,
// one per drive of a finger. Right sides: 0 for the equilibrium, else 1.
class EquilibriumProgram {
 public:
  EquilibriumProgram(const std::vector<BearingContact>& contacts, const HoldingOptions& options)
      : contacts_(contacts), options_(options) {
    number_drives();
    for (const BearingContact& contact : contacts) {
      const Eigen::Matrix3d frame = contact.frame();
      const Eigen::Vector3d arm = contact.point() - options.load_point;
      ContactPrices& prices = prices_of_.emplace_back();
      prices.by_force = -frame.transpose();
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        prices.by_moment.row(axis) = -arm.cross(frame.col(axis)) / wrench_length_m;
      prices.by_drive = -frame.transpose() * contact.outward() / options.closing_force_n;
      arms_.push_back(arm);
    }
    stride_ = (rows_ + group - 1) / group * group;
    inverse_.setIdentity(stride_, rows_);
    values_.setZero(stride_);
    values_.segment(6, rows_ - 6).setOnes();
    column_.setZero(stride_);
    change_.setZero(stride_);
    smallest_.setZero(stride_);
    bounds_.setZero(stride_);
    prices_.setZero(rows_);
    kinds_.assign(static_cast<std::size_t>(rows_), Kind::slack);
    std::fill_n(kinds_.begin(), 6, Kind::artificial);
  }

  // Starts from the basis of the previous direction, if any: the new pull first replaces the
  // previous pull, as part of the same program.
  double max_pull(const Eigen::Vector3d& direction, double sufficient_force_n) {
    if (pull_ >= 0) formers_.push_back(std::exchange(pull_, -1));
    direction_ = direction;
    make_pull();
    if (!enter(Kind::pull)) return 0.0;
    // Cost of the previous pull relative to the new one; a small cost leads to it on the way.
    double cost = 0.1;
    constexpr double max_cost = 1e9;
    constexpr int max_pivots = 2000;
    for (int pivot = 0; pivot < max_pivots && cost < max_cost; ++pivot) {
      if (pull_ >= 0 && values_[pull_] >= sufficient_force_n && are_formers_gone() &&
          true_value(pull_) >= sufficient_force_n)
        break;
      prices_.setZero();
      if (pull_ >= 0) prices_ += inverse_.row(pull_);
      for (const Eigen::Index former : formers_) prices_ -= cost * inverse_.row(former);
      const double gain = price(pull_ < 0);
      if (gain > 1e-11 * (1.0 + (pull_ < 0 ? 0.0 : std::abs(values_[pull_])))) {
        if (!enter(entering_)) break;
      } else if (are_formers_gone()) {
        break;
      } else {
        cost *= 100.0;
      }
    }
    return pull_ < 0 ? 0.0 : std::max(0.0, true_value(pull_));
  }

 private:
  enum class Kind : std::uint8_t { slack, artificial, pull, contact };

  // Prices of a contact force along normal, drag and lateral, from the rows of the equilibrium and
  // of the drive.
  struct ContactPrices {
    Eigen::Matrix3d by_force;
    Eigen::Matrix3d by_moment;
    Eigen::Vector3d by_drive;
  };

  // Numbers the drives of fingers with contacts.
  void number_drives() {
    std::vector<Eigen::Index> row_of_finger;
    rows_ = static_cast<Eigen::Index>(6 + contacts_.size());
    for (const BearingContact& contact : contacts_) {
      if (contact.finger() >= row_of_finger.size()) row_of_finger.resize(contact.finger() + 1, -1);
      Eigen::Index& row = row_of_finger[contact.finger()];
      if (row < 0) {
        row = rows_++;
        ++fingers_;
      }
      drive_rows_.push_back(row);
    }
  }
  // Returns c_k / m of a rigid finger.
  double reaction_of(const BearingContact& contact) const {
    const double sine = contact.normal().dot(contact.outward());
    const double cosine = contact.normal().dot(options_.axis);
    return std::max(0.0, sine * cosine) / (1.0 + sine * sine) / static_cast<double>(fingers_);
  }
  void make_pull() {
    column_.setZero();
    column_.head<3>() = direction_;
    if (!options_.holds_when_closed) return;
    for (std::size_t n = 0; n < contacts_.size(); ++n) {
      double& fraction = column_[drive_rows_[n]];
      fraction = std::min(fraction, -reaction_of(contacts_[n]) / options_.closing_force_n);
    }
  }
  // Value of a basic variable without the perturbation.
  double true_value(Eigen::Index row) const {
    return inverse_.row(row).segment(6, rows_ - 6).sum();
  }
  bool are_formers_gone() const {
    constexpr double negligible_n = 1e-9;
    return std::all_of(formers_.begin(), formers_.end(),
                       [&](Eigen::Index row) { return true_value(row) <= negligible_n; });
  }

  // Creates the column with the largest gain, and returns the gain.
  double price(bool with_pull) {
    const Eigen::Vector3d force_price = prices_.head<3>();
    const Eigen::Vector3d moment_price = prices_.segment<3>(3);
    const auto worth_of = [&](std::size_t n) -> Eigen::Vector3d {
      const ContactPrices& by = prices_of_[n];
      return by.by_force * force_price + by.by_moment * moment_price +
             by.by_drive * prices_[drive_rows_[n]];
    };
    double most = 0.0;
    std::size_t best = contacts_.size();
    for (std::size_t n = 0; n < contacts_.size(); ++n) {
      const double gain = contacts_[n].max_local_product(worth_of(n), options_.sharing) -
                          prices_[6 + static_cast<Eigen::Index>(n)];
      if (gain <= most) continue;
      most = gain;
      best = n;
    }
    Eigen::Index slack = -1;
    for (Eigen::Index row = 6; row < rows_; ++row) {
      if (-prices_[row] <= most) continue;
      most = -prices_[row];
      slack = row;
    }
    column_.setZero();
    entering_ = slack >= 0 ? Kind::slack : Kind::contact;
    if (slack >= 0) {
      column_[slack] = 1.0;
    } else if (best < contacts_.size()) {
      const Eigen::Vector3d force =
          contacts_[best].best_local_force(worth_of(best), options_.sharing);
      column_.head<3>() = force;
      column_.segment<3>(3) = arms_[best].cross(force) / wrench_length_m;
      column_[6 + static_cast<Eigen::Index>(best)] = 1.0;
      column_[drive_rows_[best]] = contacts_[best].outward().dot(force) / options_.closing_force_n;
    }
    if (!with_pull) return most;
    const Eigen::VectorXd other = column_;
    make_pull();
    const double gain = 1.0 - prices_.dot(column_.head(rows_));
    if (gain > most) {
      entering_ = Kind::pull;
      return gain;
    }
    column_ = other;
    return most;
  }

  // Lets `column_` enter the basis; returns false if the step is unbounded.
  bool enter(Kind kind) {
    multiply(inverse_.data(), column_.data(), change_.data(), rows_, stride_);
    // Smaller changes are rounding errors. Division by one would damage the inverse.
    const double smallest = 1e-9 * change_.cwiseAbs().maxCoeff();
    Eigen::Index leaving = changing_artificial(smallest);
    double step = 0.0;
    if (leaving < 0) {
      perturb();
      leaving = first_at_zero(smallest, step);
      if (leaving < 0) return false;
    }
    values_ -= step * change_;
    values_[leaving] = step > 0.0 || !is_perturbed_ ? step : small_value(leaving);
    const double pivot = change_[leaving];
    change_[leaving] = 0.0;
    exchange(inverse_.data(), change_.data(), pivot, leaving, rows_, stride_);
    if (kinds_[static_cast<std::size_t>(leaving)] == Kind::artificial) --artificials_;
    std::erase(formers_, leaving);
    if (leaving == pull_) pull_ = -1;
    if (kind == Kind::pull) pull_ = leaving;
    kinds_[static_cast<std::size_t>(leaving)] = kind;
    return true;
  }

  // Artificial variables must stay 0: they leave as soon as they would change.
  Eigen::Index changing_artificial(double smallest) const {
    Eigen::Index found = -1;
    double largest = smallest;
    for (Eigen::Index row = 0; artificials_ > 0 && row < rows_; ++row)
      if (kinds_[static_cast<std::size_t>(row)] == Kind::artificial &&
          std::abs(change_[row]) > largest) {
        largest = std::abs(change_[row]);
        found = row;
      }
    return found;
  }

  // Row of the first value that becomes 0 as the column enters, after `step`.
  Eigen::Index first_at_zero(double smallest, double& step) {
    smallest_.setConstant(smallest);
    for (Eigen::Index row = 0; artificials_ > 0 && row < rows_; ++row)
      if (kinds_[static_cast<std::size_t>(row)] == Kind::artificial)
        smallest_[row] = std::numeric_limits<double>::infinity();
    find_bounds(values_.data(), change_.data(), smallest_.data(), bounds_.data(), stride_);
    Eigen::Index first = -1;
    step = std::numeric_limits<double>::infinity();
    for (Eigen::Index row = 0; row < rows_; ++row) {
      if (bounds_[row] >= step) continue;
      step = bounds_[row];
      first = row;
    }
    return first;
  }

  // Many basic variables are 0 initially. Small different values prevent cycling; results are
  // computed without them.
  void perturb() {
    if (is_perturbed_) return;
    is_perturbed_ = true;
    for (Eigen::Index row = 0; row < rows_; ++row)
      if (kinds_[static_cast<std::size_t>(row)] != Kind::artificial)
        values_[row] += small_value(row);
  }

  const std::vector<BearingContact>& contacts_;
  const HoldingOptions& options_;
  std::vector<ContactPrices> prices_of_;
  std::vector<Eigen::Vector3d> arms_;
  std::vector<Eigen::Index> drive_rows_;  // per contact
  std::ptrdiff_t fingers_ = 0;            // number with contacts
  Eigen::Index rows_ = 0;
  Eigen::Index stride_ = 0;  // stride of the columns
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd values_;
  Eigen::Vector3d direction_;  // direction of the pull
  Eigen::VectorXd column_;     // entering column
  Eigen::VectorXd change_;     // change of the values per step
  Eigen::VectorXd smallest_;
  Eigen::VectorXd bounds_;
  Eigen::RowVectorXd prices_;  // per row: derivative of the pull by its right side
  std::vector<Kind> kinds_;
  Eigen::Index pull_ = -1;  // row of the pull; -1: not in the basis
  std::vector<Eigen::Index> formers_;
  int artificials_ = 6;
  Kind entering_ = Kind::slack;
  bool is_perturbed_ = false;
};

}  // namespace

double holding_force(const std::vector<BearingContact>& contacts, const Eigen::Vector3d& direction,
                     const HoldingOptions& options, double sufficient_force_n) {
  if (contacts.size() < 2) return 0.0;  // one contact cannot balance moments
  return EquilibriumProgram(contacts, options).max_pull(direction, sufficient_force_n);
}

WeakestDirection min_holding_force(const std::vector<BearingContact>& contacts,
                                   const HoldingOptions& options, std::size_t first) {
  if (contacts.size() < 2) return {0.0, first};
  const std::vector<PullDirection>& directions = pull_directions();
  EquilibriumProgram program(contacts, options);
  constexpr double all = std::numeric_limits<double>::infinity();
  WeakestDirection least{program.max_pull(directions[first].vector, all), first};
  // Each direction is adjacent to its predecessor, so that few contacts change their forces.
  constexpr std::size_t ways[] = {0, 1, 9, 10, 2, 3, 11, 12, 4, 5, 13, 14, 6, 7, 15, 16, 8};
  for (const std::size_t n : ways) {
    if (n == first) continue;
    if (!(least.force_n > 0.0)) break;
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
