#include "libmap/ros/mcap_records.h"

#include <lz4frame.h>
#include <zstd.h>

#include <array>
#include <memory>

#include "libmap/core/error.h"

namespace libmap::mcap {

namespace {

constexpr std::uint64_t max_chunk_bytes = std::uint64_t{1} << 30;

Error broken_chunk(const std::string& compression) {
  return Error("is broken", {.field = "chunk of " + compression});
}

// Calls step(input, input size, output, output size), which sets both sizes to what it has used and
// made and returns whether more is to come, until nothing is.
template <typename Step>
std::string expand(const std::string& compression, std::string_view bytes, std::uint64_t size,
                   const Step& step) {
  std::string result;
  auto piece = std::make_unique<std::array<char, 1U << 17U>>();
  bool more = true;
  while (more) {
    std::size_t used = bytes.size();
    std::size_t made = piece->size();
    more = step(bytes.data(), used, piece->data(), made);
    bytes.remove_prefix(used);
    if (made > size - result.size() || (more && used == 0 && made == 0))
      throw broken_chunk(compression);
    result.append(piece->data(), made);
  }
  return result;
}

std::string expand_lz4(std::string_view bytes, std::uint64_t size) {
  LZ4F_dctx* opened = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&opened, LZ4F_VERSION))) throw std::bad_alloc();
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      opened, LZ4F_freeDecompressionContext);
  return expand("lz4", bytes, size,
                [&](const char* input, std::size_t& used, char* output, std::size_t& made) {
                  const std::size_t left =
                      LZ4F_decompress(context.get(), output, &made, input, &used, nullptr);
                  if (LZ4F_isError(left)) throw broken_chunk("lz4");
                  return left != 0;
                });
}

std::string expand_zstd(std::string_view bytes, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                     ZSTD_freeDCtx);
  return expand("zstd", bytes, size,
                [&](const char* input, std::size_t& used, char* output, std::size_t& made) {
                  ZSTD_inBuffer in = {input, used, 0};
                  ZSTD_outBuffer out = {output, made, 0};
                  const std::size_t left = ZSTD_decompressStream(context.get(), &out, &in);
                  if (ZSTD_isError(left)) throw broken_chunk("zstd");
                  used = in.pos;
                  made = out.pos;
                  return left != 0;
                });
}

}  // namespace

std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size) {
  if (size > max_chunk_bytes)
    throw Error("is too large",
                {.field = "size of a chunk", .value = std::to_string(size), .bound = "<= 1 GiB"});
  std::string result;
  if (compression == "lz4")
    result = expand_lz4(bytes, size);
  else if (compression == "zstd")
    result = expand_zstd(bytes, size);
  else if (compression.empty())
    result = bytes;
  else
    throw Error(
        "is not known",
        {.field = "compression of a chunk", .value = compression, .bound = "lz4, zstd or none"});
  if (result.size() != size)
    throw Error("has another size", {.field = "chunk",
                                     .value = std::to_string(result.size()) + " bytes",
                                     .bound = std::to_string(size)});
  return result;
}

std::string compress_chunk(const std::string& compression, const std::string& bytes) {
  if (compression.empty()) return bytes;
  const bool zstd = compression == "zstd";
  std::string result(
      zstd ? ZSTD_compressBound(bytes.size()) : LZ4F_compressFrameBound(bytes.size(), nullptr),
      '\0');
  const std::size_t size =
      zstd ? ZSTD_compress(result.data(), result.size(), bytes.data(), bytes.size(), 3)
           : LZ4F_compressFrame(result.data(), result.size(), bytes.data(), bytes.size(), nullptr);
  if (zstd ? ZSTD_isError(size) : LZ4F_isError(size))
    throw Error("a chunk cannot be compressed", {}, ErrorKind::failed);
  result.resize(size);
  return result;
}

}  // namespace libmap::mcap
