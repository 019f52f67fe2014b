// Detects the address and the thread sanitizer, by macros of GCC and features of clang.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
#define GRASPMAP_TEST_ADDRESS_SANITIZER 1
#elif defined(__SANITIZE_THREAD__)
#define GRASPMAP_TEST_THREAD_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define GRASPMAP_TEST_ADDRESS_SANITIZER 1
#elif __has_feature(thread_sanitizer)
#define GRASPMAP_TEST_THREAD_SANITIZER 1
#endif
#endif

namespace graspmap_test {

#if defined(GRASPMAP_TEST_ADDRESS_SANITIZER)
inline constexpr bool has_address_sanitizer = true;
#else
inline constexpr bool has_address_sanitizer = false;
#endif
#if defined(GRASPMAP_TEST_THREAD_SANITIZER)
inline constexpr bool has_thread_sanitizer = true;
#else
inline constexpr bool has_thread_sanitizer = false;
#endif

// False with sanitizers: they need much memory, and a memory limit would end the program.
inline constexpr bool memory_can_be_limited = !has_address_sanitizer && !has_thread_sanitizer;

}  // namespace graspmap_test
