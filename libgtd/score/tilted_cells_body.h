// The portable function of tilted_cells.h but for its instruction set; for tilted_cells.cc alone,
// which includes this once for each.

using Lanes [[gnu::vector_size(lanes * sizeof(double))]] = double;
using Wholes [[gnu::vector_size(lanes * sizeof(int))]] = int;

// Without asking for alignment. Not returned: how vectors are depends on the instruction set.
inline void load_lanes(const double* values, Lanes& loaded) {
  __builtin_memcpy(&loaded, values, sizeof(Lanes));
}

std::size_t find_cells(const double* const points[3], std::size_t count,
                       const TiltedLattice& lattice, const TiltedBox& box, int* cells) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < count; k += lanes) {
    Lanes x;
    Lanes y;
    Lanes z;
    load_lanes(points[0] + k, x);
    load_lanes(points[1] + k, y);
    load_lanes(points[2] + k, z);
    x -= lattice.origin[0];
    y -= lattice.origin[1];
    z -= lattice.origin[2];
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
