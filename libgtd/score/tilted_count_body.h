// The count of tilted_cells.h, compiled for each instruction set; for tilted_cells.cc alone.

std::uint32_t count_common(const std::uint64_t* a, const std::uint64_t* b, std::size_t words) {
  std::uint64_t count = 0;
  for (std::size_t n = 0; n < words; ++n)
    count += static_cast<std::uint64_t>(__builtin_popcountll(a[n] & b[n]));
  return static_cast<std::uint32_t>(count);
}
