# Functions that define libraries, commands and tests with common flags.
include(GNUInstallDirs)

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Required for precompiled headers (manual of ccache).
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()

# Targets are not linked again if a shared library changes.
set(CMAKE_LINK_DEPENDS_NO_SHARED ON)

set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
# Relative paths: an installation can be moved. The libraries have a separate folder because their ABI
# changes with every version.
set(graspmap_library_folder ${CMAKE_INSTALL_LIBDIR}/graspmap)
file(RELATIVE_PATH graspmap_lib_from_bin
  /prefix/${CMAKE_INSTALL_LIBEXECDIR}/graspmap /prefix/${graspmap_library_folder})

set(graspmap_sanitizer_flags "")
if(GRASPMAP_SANITIZE)
  string(REPLACE ";" "," sanitizers "${GRASPMAP_SANITIZE}")
  set(graspmap_sanitizer_flags -fsanitize=${sanitizers} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  # GCC 12 reports false warnings for OpenMesh in instrumented code.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    list(APPEND graspmap_sanitizer_flags -Wno-maybe-uninitialized)
  endif()
endif()

# Eigen changes its allocator under sanitizers. PCL is compiled without them and frees memory that
# graspmap allocates.
set(graspmap_sanitizer_definitions $<$<BOOL:${GRASPMAP_SANITIZE}>:EIGEN_MALLOC_ALREADY_ALIGNED=1>)

# Several sources are compiled as one (CMAKE_UNITY_BUILD in the presets), because instantiating Eigen's
# templates in each source takes most of the time. Sources with their own options are compiled alone.
set(CMAKE_UNITY_BUILD_BATCH_SIZE 12)

# For libraries. graspmap_compile_quickly sets -O1.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

# Compiles a target with -O1, for commands and tests.
function(graspmap_compile_quickly target)
  # At -O1, GCC 12 reports false warnings for Eigen's matrices and for lists of strings.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:-O1>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized;-Wno-array-bounds;-Wno-stringop-overflow>)
endfunction()

# graspmap_headers(NAME HEADERS <HEADER>... [LINK TARGET...]): target graspmap_NAME of precompiled
# headers: HEADERS, Eigen and the standard library. graspmap_precompiled(TARGET graspmap_NAME) uses it.
function(graspmap_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LINK" ${ARGN})
  set(target graspmap_${name})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Only the precompiled headers of this source are used.\n")
  add_library(${target} STATIC ${source})
  graspmap_set_flags(${target})
  graspmap_compile_quickly(${target})
  target_link_libraries(${target} PRIVATE Eigen3::Eigen ${ARG_LINK})
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  target_precompile_headers(${target} PRIVATE <Eigen/Geometry> <algorithm> <array> <cmath> <cstdint>
    <filesystem> <functional> <limits> <map> <numbers> <optional> <set> <string> <string_view>
    <utility> <vector> ${ARG_HEADERS})
endfunction()
function(graspmap_precompiled target headers)
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  target_precompile_headers(${target} REUSE_FROM ${headers})
endfunction()

function(graspmap_set_flags target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET default
    POSITION_INDEPENDENT_CODE ON)
  # -Wno-restrict: GCC 12 reports false overlaps in std::string's operator+ (GCC bug 105651).
  # -ffp-contract=off: results must not depend on the machine, so no fused multiply-adds.
  # In a unity build, a name of one file may shadow a name of another.
  if(CMAKE_UNITY_BUILD)
    set(shadow $<$<CXX_COMPILER_ID:GNU>:-Wshadow=local -Wno-subobject-linkage>)
  else()
    set(shadow -Wshadow)
  endif()
  # -fPIC for executables too: precompiled headers need the flags of the sources that use them.
  # ggc-min-heapsize: no garbage collection below 1 GB saves a tenth of the compile time.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wconversion ${shadow}
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;--param=ggc-min-heapsize=1048576> -fPIC -ffp-contract=off
    $<$<BOOL:${GRASPMAP_WARNINGS_AS_ERRORS}>:-Werror> ${graspmap_sanitizer_flags})
  target_compile_definitions(${target} PRIVATE ${graspmap_sanitizer_definitions})
  target_link_options(${target} PRIVATE ${graspmap_sanitizer_flags})
endfunction()

# Measures the line coverage of a target if GRASPMAP_COVERAGE is set. Counts match source lines only at
# low optimization. The tests themselves are not counted and run at full speed. GCC 12 reports false
# uninitialized memory in OpenMesh's properties at -O1.
function(graspmap_count_lines target)
  if(GRASPMAP_COVERAGE)
    target_compile_options(${target} PRIVATE --coverage -O1 -fprofile-update=atomic
      -Wno-maybe-uninitialized)
    target_link_options(${target} PUBLIC --coverage)
  endif()
endfunction()

# GCC's pragmas select the instruction set of single functions. Other compilers use the portable loops,
# which give identical results (libmap/core/instruction_set_loops.h).
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(graspmap_x86_loops GRASPMAP_X86_LOOPS)
endif()

# graspmap_library(NAME SOURCES FILE... [LINK TARGET...] [PUBLIC_LINK TARGET...]
#                  [INCLUDE DIR...] [DEFINE NAME...])
# Shared library graspmap_NAME. LINK and INCLUDE are private: public headers include only the standard
# library, Eigen and this project.
function(graspmap_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;PUBLIC_LINK;INCLUDE;DEFINE" ${ARGN})
  set(target graspmap_${name})
  add_library(${target} SHARED ${ARG_SOURCES})
  add_library(graspmap::${name} ALIAS ${target})
  graspmap_set_flags(${target})
  graspmap_count_lines(${target})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/graspmap>)
  target_include_directories(${target} SYSTEM PRIVATE ${ARG_INCLUDE})
  target_compile_definitions(${target} PRIVATE ${ARG_DEFINE})
  target_link_libraries(${target} PUBLIC Eigen3::Eigen ${ARG_PUBLIC_LINK} PRIVATE ${ARG_LINK})
  set_target_properties(${target} PROPERTIES VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} EXPORT_NAME ${name}
    INSTALL_RPATH "$ORIGIN")
  set_property(GLOBAL APPEND PROPERTY graspmap_libraries ${target})
endfunction()

# graspmap_command(NAME [SOURCES FILE...] [LINK TARGET...]): command `graspmap NAME`, built from NAME.cc
# and SOURCES. Each command is a separate program that `graspmap` starts, so that it loads only the
# libraries that it uses. Loading all of them takes 0.16 s.
function(graspmap_command name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  set(target graspmap-${name})
  add_executable(${target} ${name}.cc ${ARG_SOURCES})
  graspmap_set_flags(${target})
  graspmap_compile_quickly(${target})
  graspmap_count_lines(${target})
  graspmap_precompiled(${target} graspmap_command_headers)
  target_link_libraries(${target} PRIVATE
    graspmap_command_parts graspmap_command_line ${ARG_LINK})
  set_target_properties(${target} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/libexec/graspmap
    INSTALL_RPATH "$ORIGIN/${graspmap_lib_from_bin}")
  set_property(GLOBAL APPEND PROPERTY graspmap_commands ${target})
endfunction()

# Environment of tests that render. Leak detection is off, since Mesa's driver keeps memory until its
# library is unloaded.
set(graspmap_drawing_environment "")
if(GRASPMAP_SANITIZE)
  set(graspmap_drawing_environment ASAN_OPTIONS=detect_leaks=0:protect_shadow_gap=0)
endif()

# graspmap_test(NAME SOURCES FILE... [LINK TARGET...] [INCLUDE DIR...] [DRAWS] [SHARDS N]): a GoogleTest
# program test_NAME. ctest runs it in N processes (default: 1), not in one process per case, because
# loading the libraries takes longer than most cases. DRAWS: the program renders.
function(graspmap_test name)
  cmake_parse_arguments(ARG "DRAWS" "SHARDS" "SOURCES;LINK;INCLUDE" ${ARGN})
  set(target test_${name})
  add_executable(${target} ${ARG_SOURCES})
  graspmap_set_flags(${target})
  graspmap_compile_quickly(${target})
  graspmap_precompiled(${target} graspmap_test_headers)
  target_include_directories(${target} SYSTEM PRIVATE ${ARG_INCLUDE})
  target_link_libraries(${target} PRIVATE graspmap_test_support ${ARG_LINK})
  set_target_properties(${target} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  set(environment "")
  if(ARG_DRAWS)
    set(environment ${graspmap_drawing_environment})
  endif()
  set(shards 1)
  if(ARG_SHARDS)
    set(shards ${ARG_SHARDS})
  endif()
  foreach(shard RANGE 1 ${shards})
    set(test ${name})
    if(shards GREATER 1)
      set(test ${name}-${shard})
    endif()
    add_test(NAME ${test} COMMAND ${target})
    math(EXPR index "${shard} - 1")
    # Exit code 77: all cases were skipped.
    set_tests_properties(${test} PROPERTIES TIMEOUT 1800 SKIP_RETURN_CODE 77
      ENVIRONMENT "GTEST_TOTAL_SHARDS=${shards};GTEST_SHARD_INDEX=${index};${environment}")
  endforeach()
endfunction()
