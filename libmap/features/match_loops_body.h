// Implements match_loops.h; included by match_loops.cc once per instruction set, whose vector
// registers have GRASPMAP_REGISTER bytes.

constexpr int width = GRASPMAP_REGISTER / static_cast<int>(sizeof(float));

using Floats [[gnu::vector_size(GRASPMAP_REGISTER)]] = float;
using Ints [[gnu::vector_size(GRASPMAP_REGISTER)]] = int;

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

// Largest and second largest product in each lane, and the index of the largest.
struct Largest {
  Floats first;
  Floats second;
  Ints nearest;
};

inline void add(const Floats& product, const Ints& index, Largest& largest) {
  const Floats smaller = product > largest.first ? largest.first : product;
  largest.nearest = product > largest.first ? index : largest.nearest;
  largest.first = product > largest.first ? product : largest.first;
  largest.second = smaller > largest.second ? smaller : largest.second;
}

inline void reduce(const Largest& largest, int n, const libmap::MatchLoops::Output& output) {
  float first = -2.0F;
  float second = -2.0F;
  int nearest = -1;
  for (int lane = 0; lane < width; ++lane) {
    const float value = largest.first[lane];
    const int index = largest.nearest[lane];
    if (value > first || (value == first && index < nearest)) {
      second = first > largest.second[lane] ? first : largest.second[lane];
      first = value;
      nearest = index;
    } else if (value > second) {
      second = value;
    }
  }
  output.first_of_a[n] = first;
  output.second_of_a[n] = second;
  output.nearest_of_a[n] = nearest;
}

void find_nearest(const libmap::MatchLoops::Input& input,
                  const libmap::MatchLoops::Output& output) {
  constexpr int group = libmap::MatchLoops::group;
  constexpr int columns = 2;
  Ints lane_index = {};
  for (int lane = 0; lane < width; ++lane) lane_index[lane] = lane;
  for (int a = 0; a < input.a_count; a += group) {
    const float* const of_a = input.a + static_cast<long>(a) * input.size;
    Largest largest[group];
    for (Largest& one : largest) one = {Floats{} - 2.0F, Floats{} - 2.0F, Ints{} - 1};
    for (int b = 0; b < input.b_count; b += columns * width) {
      Floats product[group][columns];
      for (int column = 0; column < columns; ++column)
        for (int n = 0; n < group; ++n)
          product[n][column] = load<Floats>(input.bias_of_b + b + column * width);
      const float* of_b = input.b + b;
      for (int k = 0; k < input.size; ++k, of_b += input.b_count) {
        const Floats left = load<Floats>(of_b);
        const Floats right = load<Floats>(of_b + width);
        for (int n = 0; n < group; ++n) {
          const float value = of_a[n * input.size + k];
          product[n][0] += left * value;
          product[n][1] += right * value;
        }
      }
      for (int column = 0; column < columns; ++column) {
        const int at = b + column * width;
        Floats first = load<Floats>(output.first_of_b + at);
        Ints nearest = load<Ints>(output.nearest_of_b + at);
        for (int n = 0; n < group; ++n) {
          const Floats& value = product[n][column];
          add(value, lane_index + at, largest[n]);
          nearest = value > first ? Ints{} + (a + n) : nearest;
          first = value > first ? value : first;
        }
        store(first, output.first_of_b + at);
        store(nearest, output.nearest_of_b + at);
      }
    }
    for (int n = 0; n < group; ++n) reduce(largest[n], a + n, output);
  }
}

constexpr libmap::MatchLoops all{find_nearest};
