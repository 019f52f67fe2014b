# The ways in which this project makes its targets: one function each for a library, a command and
# a test, so that flags stand in one place.
include(GNUInstallDirs)

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # As ccache's manual asks for precompiled headers.
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()

# A shared library that was built anew is loaded, not linked again.
set(CMAKE_LINK_DEPENDS_NO_SHARED ON)

set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
# Installed files find their libraries beside them, wherever the prefix is moved to.
# The libraries have a folder of their own: their ABI changes with every version.
set(graspmap_library_folder ${CMAKE_INSTALL_LIBDIR}/graspmap)
file(RELATIVE_PATH graspmap_lib_from_bin
  /prefix/${CMAKE_INSTALL_LIBEXECDIR}/graspmap /prefix/${graspmap_library_folder})

set(graspmap_sanitizer_flags "")
if(GRASPMAP_SANITIZE)
  string(REPLACE ";" "," sanitizers "${GRASPMAP_SANITIZE}")
  set(graspmap_sanitizer_flags -fsanitize=${sanitizers} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
endif()

# Eigen allocates in its own way under sanitizers; PCL was compiled without, and frees what we
# allocate.
set(graspmap_sanitizer_definitions $<$<BOOL:${GRASPMAP_SANITIZE}>:EIGEN_MALLOC_ALREADY_ALIGNED=1>)

# Several sources are compiled as one (CMAKE_UNITY_BUILD, in the presets): most of the time goes into
# Eigen's templates, which each of them would instantiate again. Files with options of their own
# stay apart.
set(CMAKE_UNITY_BUILD_BATCH_SIZE 12)

# Libraries; graspmap_compile_quickly has -O1.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

# For targets that do little themselves.
function(graspmap_compile_quickly target)
  # At -O1 GCC 12 takes members of Eigen's matrices and strings of lists for uninitialized or short.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:-O1>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized;-Wno-array-bounds;-Wno-stringop-overflow>)
endfunction()

# graspmap_headers(NAME HEADERS <HEADER>... [LINK TARGET...]): graspmap_NAME, headers that are compiled
# once for all targets that name it in graspmap_precompiled(TARGET graspmap_NAME): those given, Eigen
# and the standard library's.
function(graspmap_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LINK" ${ARGN})
  set(target graspmap_${name})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Only its precompiled headers are of use.\n")
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
  # -Wno-restrict: GCC 12 sees overlaps in std::string's operator+ (GCC bug 105651).
  # No contraction into fused multiply-adds: results must not depend on the machine.
  # Where sources are compiled together, a name of one file may hide that of another.
  if(CMAKE_UNITY_BUILD)
    set(shadow $<$<CXX_COMPILER_ID:GNU>:-Wshadow=local -Wno-subobject-linkage>)
  else()
    set(shadow -Wshadow)
  endif()
  # -fPIC for executables too: precompiled headers must be compiled as what includes them.
  # The compiler collects its garbage only above 1 GB: a tenth of the time of most files.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wconversion ${shadow}
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;--param=ggc-min-heapsize=1048576> -fPIC -ffp-contract=off
    $<$<BOOL:${GRASPMAP_WARNINGS_AS_ERRORS}>:-Werror> ${graspmap_sanitizer_flags})
  target_compile_definitions(${target} PRIVATE ${graspmap_sanitizer_definitions})
  target_link_options(${target} PRIVATE ${graspmap_sanitizer_flags})
endfunction()

# Counts which lines of a target are run, where that is asked for. Counts are those of the source
# only where little is optimized; the tests themselves run at full speed. GCC 12 sees uninitialized
# memory in OpenMesh's properties at -O1.
function(graspmap_count_lines target)
  if(GRASPMAP_COVERAGE)
    target_compile_options(${target} PRIVATE --coverage -O1 -fprofile-update=atomic
      -Wno-maybe-uninitialized)
    target_link_options(${target} PUBLIC --coverage)
  endif()
endfunction()

# GCC's pragmas choose the instruction set of single functions; other compilers get the portable
# loops, whose results are the same (libmap/core/instruction_set_loops.h).
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(graspmap_x86_loops GRASPMAP_X86_LOOPS)
endif()

# graspmap_library(NAME SOURCES FILE... [LINK TARGET...] [PUBLIC_LINK TARGET...]
#                  [INCLUDE DIR...] [DEFINE NAME...])
# A shared library graspmap_NAME. LINK and INCLUDE stay inside it: public headers show the standard
# library, Eigen and this project alone.
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

# graspmap_command(NAME [SOURCES FILE...] [LINK TARGET...]): the command `graspmap NAME`, made from
# NAME.cc and further files. Each command is a program of its own, started by `graspmap`, so that it loads only the
# libraries that it uses: all of them together take 0.16 s to load.
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

# Of tests that render: leaks are not looked for, since Mesa's driver keeps memory until its library
# is gone.
set(graspmap_drawing_environment "")
if(GRASPMAP_SANITIZE)
  set(graspmap_drawing_environment ASAN_OPTIONS=detect_leaks=0:protect_shadow_gap=0)
endif()

# graspmap_test(NAME SOURCES FILE... [LINK TARGET...] [INCLUDE DIR...] [DRAWS] [SHARDS N]): a GoogleTest
# program test_NAME, which ctest runs in N processes (1). A process per case would spend more time on
# loading libraries than on most cases. DRAWS: it renders.
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
    # 77: all of its cases were skipped.
    set_tests_properties(${test} PROPERTIES TIMEOUT 1800 SKIP_RETURN_CODE 77
      ENVIRONMENT "GTEST_TOTAL_SHARDS=${shards};GTEST_SHARD_INDEX=${index};${environment}")
  endforeach()
endfunction()
