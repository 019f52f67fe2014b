// The portable function of tilted_cells.h but for its instruction set; for tilted_cells.cc alone,
// which includes this once for each.

using Lanes [[gnu::vector_size(lanes * sizeof(double))]] = double;
using Wholes [[gnu::vector_size(lanes * sizeof(int))]] = int;

using LanesInMemory
    [[gnu::vector_size(sizeof(Lanes)), gnu::aligned(sizeof(double)), gnu::may_alias]] = double;

inline const LanesInMemory& lanes_at(const double* values) {
  return *reinterpret_cast<const LanesInMemory*>(values);
}

std::size_t find_cells(const double* const points[3], std::size_t count,
                       const TiltedLattice& lattice, const TiltedBox& box, int* cells) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < count; k += lanes) {
    const Lanes x = lanes_at(points[0] + k) - lattice.origin[0];
    const Lanes y = lanes_at(points[1] + k) - lattice.origin[1];
    const Lanes z = lanes_at(points[2] + k) - lattice.origin[2];
    Wholes cell = {};
    Wholes is_inside = {};
    is_inside -= 1;
    for (int a = 0; a < 3; ++a) {
      const double* axis = lattice.axes[a];
      const Lanes place = axis[0] * x + axis[1] * y + axis[2] * z + 0.5;
      const Lanes begin = Lanes{} + box.low[a];
      const Lanes end = begin + box.size[a];
      // False for what is not a number; far ones do not reach the conversion.
      const auto is_in = (place >= begin) & (place < end);
      const Wholes cut = __builtin_convertvector(is_in ? place : Lanes{}, Wholes);
      const auto is_above = __builtin_convertvector(cut, Lanes) > place;
      const Wholes at = cut + __builtin_convertvector(is_above, Wholes) - box.low[a];
      is_inside &= __builtin_convertvector(is_in, Wholes);
      cell += at * box.stride[a];
    }
    for (std::size_t n = 0; n < lanes; ++n) {
      cells[found] = cell[n];
      found += is_inside[n] != 0 ? 1 : 0;
    }
  }
  return found;
}
