# cmake --install: the program, its commands, libraries, headers, data and the CMake package, so that
# find_package(graspmap) gives graspmap::map and graspmap::gtd.
include(CMakePackageConfigHelpers)

get_property(graspmap_libraries GLOBAL PROPERTY graspmap_libraries)
get_property(graspmap_commands GLOBAL PROPERTY graspmap_commands)

install(TARGETS graspmap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS ${graspmap_commands}
  RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/graspmap)
install(TARGETS ${graspmap_libraries} EXPORT graspmap_targets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY libmap libgtd DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/graspmap
  FILES_MATCHING PATTERN "*.h")
install(DIRECTORY data/grippers data/rigs data/scenarios data/scenes data/sites data/field_test
  DESTINATION ${CMAKE_INSTALL_DATADIR}/graspmap)
install(DIRECTORY pipelines DESTINATION ${CMAKE_INSTALL_DATADIR}/graspmap)

set(graspmap_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/graspmap)
install(EXPORT graspmap_targets NAMESPACE graspmap:: DESTINATION ${graspmap_cmake_folder})
configure_package_config_file(cmake/graspmapConfig.cmake.in
  ${PROJECT_BINARY_DIR}/graspmapConfig.cmake INSTALL_DESTINATION ${graspmap_cmake_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/graspmapConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/graspmapConfig.cmake
  ${PROJECT_BINARY_DIR}/graspmapConfigVersion.cmake DESTINATION ${graspmap_cmake_folder})
