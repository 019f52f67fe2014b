// Functions of depth_plane_loops.h, included by depth_plane_loops.cc once per instruction set.

constexpr int width = GRASPMAP_REGISTER / static_cast<int>(sizeof(float));

using Floats [[gnu::vector_size(GRASPMAP_REGISTER)]] = float;
using Ints [[gnu::vector_size(GRASPMAP_REGISTER)]] = std::int32_t;
using Bits [[gnu::vector_size(GRASPMAP_REGISTER)]] = std::uint32_t;
using Bytes [[gnu::vector_size(width)]] = std::uint8_t;

template <typename Vector, typename Value>
inline Vector load(const Value* from) {
  Vector vector;
  __builtin_memcpy(&vector, from, sizeof(Vector));
  return vector;
}

template <typename Vector, typename Value>
inline void store(const Vector& vector, Value* to) {
  __builtin_memcpy(to, &vector, sizeof(Vector));
}

inline Floats load_some(const float* from, int count) {
  if (count >= width) return load<Floats>(from);
  Floats vector = {};
  __builtin_memcpy(&vector, from, static_cast<std::size_t>(count) * sizeof(float));
  return vector;
}

inline bool any(const std::uint8_t* marks) {
  std::uint8_t marked[width];
  __builtin_memcpy(marked, marks, sizeof(marked));
  std::uint64_t all = 0;
  for (int n = 0; n < width; n += 4) {
    std::uint32_t four;
    __builtin_memcpy(&four, marked + n, sizeof(four));
    all |= four;
  }
  return all != 0;
}

inline Floats absolute(const Floats& value) {
  return reinterpret_cast<Floats>(reinterpret_cast<Bits>(value) & 0x7fffffffU);
}

inline Floats square_root(Floats value) {
#if GRASPMAP_REGISTER == 64
  return Floats(_mm512_maskz_sqrt_ps(0xffff, __m512(value)));
#elif GRASPMAP_REGISTER == 32
  return Floats(_mm256_sqrt_ps(__m256(value)));
#elif defined(GRASPMAP_X86_LOOPS)
  return Floats(_mm_sqrt_ps(__m128(value)));
#else
  for (int n = 0; n < width; ++n) value[n] = __builtin_sqrtf(value[n]);
  return value;
#endif
}

inline int sum(const Ints& values) {
  int all = 0;
  for (int n = 0; n < width; ++n) all += values[n];
  return all;
}

// Lanes with an index below `count`.
inline Ints lanes_within(int count) {
  Ints lane;
  for (int n = 0; n < width; ++n) lane[n] = n;
  return lane < count;
}

inline Bytes bytes_of(const Ints& values) { return __builtin_convertvector(values, Bytes); }

DepthPlaneLoops::MeasureCounts measure(const float* depth, int count,
                                       const DepthPlaneLoops::Limits& limits, float* inverse,
                                       float* tolerance) {
  Ints unmeasured = {};
  Ints out_of_range = {};
  for (int x = 0; x < count; x += width) {
    const Floats z = load_some(depth + x, count - x);
    const Ints within = lanes_within(count - x);
    const Ints is_measured = z > 0.0F;
    const Ints is_used = is_measured & (z >= limits.min_depth_m) & (z <= limits.max_depth_m);
    unmeasured -= within & ~is_measured;
    out_of_range -= is_measured & ~is_used;
    const Floats one = is_used ? Floats{} + 1.0F : Floats{};
    const Floats divisor = is_used ? z : Floats{} + 1.0F;
    const Floats value = one / divisor;
    store(value, inverse + x);
    const Floats axial =
        limits.axial_m + (limits.axial_of_range + limits.axial_of_square * divisor) * divisor;
    store(limits.gate * axial * value * value, tolerance + x);
  }
  return {sum(unmeasured), sum(out_of_range)};
}

// Sums and gates are doubled, because halving is exact.
inline void fit_some(const float* inverse, const float* tolerance,
                     const DepthPlaneLoops::Offset* offsets, std::size_t offset_count,
                     float min_pairs, const DepthPlaneLoops::InversePlanes& planes) {
  const Floats center = load<Floats>(inverse);
  const Floats gate = 2.0F * load<Floats>(tolerance);
  const Floats twice = 2.0F * center;
  Floats mean = {};
  Floats by_column = {};
  Floats by_row = {};
  Ints counts = {};
  Ints product = {};
  for (std::size_t k = 0; k < offset_count; ++k) {
    const DepthPlaneLoops::Offset& offset = offsets[k];
    const Floats a = load<Floats>(inverse + offset.pixels);
    const Floats b = load<Floats>(inverse - offset.pixels);
    const Floats both = a + b;
    const Floats change = a - b;
    // Both pixels are measured and agree with the center within noise and slope.
    const Ints agrees = (absolute(both - twice) < gate) &
                        (absolute(change) < gate + offset.steepest * center) &
                        ((a < b ? a : b) > 0.0F);
    mean += agrees ? both : Floats{};
    const Floats slope = agrees ? change : Floats{};
    by_column += offset.dx * slope;
    by_row += offset.dy * slope;
    counts += agrees & offset.counts;
    product += agrees & offset.product;
  }
  const Floats number = __builtin_convertvector(counts & 0xff, Floats);
  const Bits squares = reinterpret_cast<Bits>(counts);
  const Floats column_square =
      __builtin_convertvector(reinterpret_cast<Ints>((squares >> 8U) & 0xfffU), Floats);
  const Floats row_square = __builtin_convertvector(reinterpret_cast<Ints>(squares >> 20U), Floats);
  const Floats mixed = __builtin_convertvector(product, Floats);
  const Floats determinant = column_square * row_square - mixed * mixed;
  // The determinant is an integer; it is 0 if all pairs are on one line.
  const Ints is_fitted = (center > 0.0F) & (number >= min_pairs) & (determinant >= 0.5F);
  const Floats divisor = is_fitted ? determinant : Floats{} + 1.0F;
  store((center + mean) / (1.0F + 2.0F * number), planes.value);
  store(0.5F * ((by_column * row_square - by_row * mixed) / divisor), planes.by_column);
  store(0.5F * ((by_row * column_square - by_column * mixed) / divisor), planes.by_row);
  store(bytes_of(is_fitted & (1 + 2 * (counts & 0xff))), planes.support);
}

void fit(const float* inverse, const float* tolerance, const std::uint8_t* wanted, int count,
         const DepthPlaneLoops::Offset* offsets, std::size_t offset_count, float min_pairs,
         const DepthPlaneLoops::InversePlanes& planes) {
  for (int x = 0; x < count; x += width) {
    std::uint8_t* const support = planes.support + x;
    if (wanted != nullptr && !any(wanted + x)) {
      store(Bytes{}, support);
      continue;
    }
    fit_some(inverse + x, tolerance + x, offsets, offset_count, min_pairs,
             {planes.value + x, planes.by_column + x, planes.by_row + x, support});
    if (wanted == nullptr) continue;
    const Bytes is_wanted = load<Bytes>(wanted + x) != 0;
    store(load<Bytes>(support) & is_wanted, support);
  }
}

// Rays left and right of pixels; at the edge of an image, the ray of the edge pixel.
struct Beside {
  Floats left;
  Floats right;
};
inline Beside beside(const float* row, int x, int count) {
  if (x > 0 && x + width < count) return {load<Floats>(row + x - 1), load<Floats>(row + x + 1)};
  Beside beside;
  for (int n = 0; n < width; ++n) {
    const int here = x + n < count ? x + n : count - 1;
    beside.left[n] = row[here > 0 ? here - 1 : 0];
    beside.right[n] = row[here + 1 < count ? here + 1 : here];
  }
  return beside;
}

DepthPlaneLoops::PlaneCounts finish(const float* inverse,
                                    const DepthPlaneLoops::InversePlanes& fitted,
                                    const DepthPlaneLoops::Rays& rays, int count, float min_cosine,
                                    const DepthPlaneLoops::Planes& planes) {
  Ints used = {};
  Ints flying = {};
  Ints grazing = {};
  const float rows = rays.above != 0 && rays.below != 0 ? 2.0F : 1.0F;
  for (int x = 0; x < count; x += width) {
    const Ints is_measured = (load<Floats>(inverse + x) > 0.0F) & lanes_within(count - x);
    if (!any(fitted.support + x)) {
      flying -= is_measured;
      store(Bytes{}, planes.support + x);
      continue;
    }
    const Ints support = __builtin_convertvector(load<Bytes>(fitted.support + x), Ints);
    const Ints has_plane = is_measured & (support != 0);
    Floats columns;
    for (int n = 0; n < width; ++n) columns[n] = x + n > 0 && x + n + 1 < count ? 2.0F : 1.0F;
    const Beside ray_x = beside(rays.x, x, count);
    const Beside ray_y = beside(rays.y, x, count);
    const Floats x_by_column = (ray_x.right - ray_x.left) / columns;
    const Floats y_by_column = (ray_y.right - ray_y.left) / columns;
    const Floats x_by_row =
        (load<Floats>(rays.x + x + rays.below) - load<Floats>(rays.x + x + rays.above)) / rows;
    const Floats y_by_row =
        (load<Floats>(rays.y + x + rays.below) - load<Floats>(rays.y + x + rays.above)) / rows;
    const Floats value = load<Floats>(fitted.value + x);
    const Floats by_column = load<Floats>(fitted.by_column + x);
    const Floats by_row = load<Floats>(fitted.by_row + x);
    const Floats rx = load<Floats>(rays.x + x);
    const Floats ry = load<Floats>(rays.y + x);
    // The plane a x + b y + c = 1/z in ray coordinates x, y has the normal (a, b, c).
    const Floats determinant = x_by_column * y_by_row - y_by_column * x_by_row;
    const Floats a = (y_by_row * by_column - y_by_column * by_row) / determinant;
    const Floats b = (x_by_column * by_row - x_by_row * by_column) / determinant;
    const Floats c = value - a * rx - b * ry;
    const Floats square = a * a + (b * b + c * c);
    const Floats length = square > 0.0F ? square_root(square) : Floats{} + 1.0F;
    const Floats nx = -(a / length);
    const Floats ny = -(b / length);
    const Floats nz = -(c / length);
    const Floats cosine = -(nx * rx + (ny * ry + nz)) / square_root(rx * rx + (ry * ry + 1.0F));
    // The comparison is also false for NaN, if the rays around the pixel do not differ.
    const Ints is_used = has_plane & (cosine >= min_cosine);
    used -= is_used;
    flying -= is_measured & ~has_plane;
    grazing -= has_plane & ~is_used;
    store(1.0F / value, planes.depth_m + x);
    store(nx, planes.normal[0] + x);
    store(ny, planes.normal[1] + x);
    store(nz, planes.normal[2] + x);
    store(cosine, planes.cosine + x);
    store(bytes_of(is_used & support), planes.support + x);
  }
  return {sum(used), sum(flying), sum(grazing)};
}

inline Floats turned(const float* row, const Floats& x, const Floats& y, const Floats& z) {
  return row[0] * x + (row[1] * y + row[2] * z);
}

void place(const DepthPlaneLoops::Planes& planes, const float* ray_x, const float* ray_y, int count,
           const DepthPlaneLoops::Placement& placement, const DepthPlaneLoops::PlacedElements& placed) {
  for (int x = 0; x < count; x += width) {
    if (!any(planes.support + x)) continue;
    const Floats depth = load<Floats>(planes.depth_m + x);
    const Floats z = depth * placement.scale;
    const Floats px = load<Floats>(ray_x + x) * z;
    const Floats py = load<Floats>(ray_y + x) * z;
    const Floats nx = load<Floats>(planes.normal[0] + x);
    const Floats ny = load<Floats>(planes.normal[1] + x);
    const Floats nz = load<Floats>(planes.normal[2] + x);
    for (int axis = 0; axis < 3; ++axis) {
      const float* const row = placement.rotation + 3 * axis;
      store(turned(row, px, py, z) + placement.translation[axis], placed.position[axis] + x);
      store(turned(row, nx, ny, nz), placed.normal[axis] + x);
    }
    const Floats sigma =
        placement.axial_m + (placement.axial_of_range + placement.axial_of_square * depth) * depth;
    const Floats support = __builtin_convertvector(
        __builtin_convertvector(load<Bytes>(planes.support + x), Ints), Floats);
    // Frontal views determine lateral position and normal better.
    store(load<Floats>(planes.cosine + x) * support / (sigma * sigma), placed.weight + x);
  }
}

void place_depths(const float* depth, const float* ray_x, const float* ray_y, int count,
                  const DepthPlaneLoops::Placement& placement, float* x, float* y) {
  for (int n = 0; n < count; n += width) {
    const Floats z = load_some(depth + n, count - n) * placement.scale;
    const Floats px = load<Floats>(ray_x + n) * z;
    const Floats py = load<Floats>(ray_y + n) * z;
    store(turned(placement.rotation, px, py, z) + placement.translation[0], x + n);
    store(turned(placement.rotation + 3, px, py, z) + placement.translation[1], y + n);
  }
}

constexpr DepthPlaneLoops all = {measure, fit, finish, place, place_depths};
