# Rules of cmake --install: program, commands, libraries, public headers, data and CMake package.
# find_package(graspmap) defines graspmap::map and graspmap::gtd. The component `development` contains
# the files for building against the libraries. tools/python installs the Python module.
include(CMakePackageConfigHelpers)
include(PublicHeaders)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME graspmap)

get_property(graspmap_libraries GLOBAL PROPERTY graspmap_libraries)
get_property(graspmap_commands GLOBAL PROPERTY graspmap_commands)

install(TARGETS graspmap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS ${graspmap_commands}
  RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/graspmap)
install(TARGETS ${graspmap_libraries} EXPORT graspmap_targets
  LIBRARY DESTINATION ${graspmap_library_folder} NAMELINK_COMPONENT development)
# Modules are loaded at run time; no target links them.
get_property(graspmap_modules GLOBAL PROPERTY graspmap_modules)
if(graspmap_modules)
  install(TARGETS ${graspmap_modules} LIBRARY DESTINATION ${graspmap_library_folder})
endif()
foreach(header IN LISTS graspmap_public_headers)
  cmake_path(GET header PARENT_PATH folder)
  install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/graspmap/${folder}
    COMPONENT development)
endforeach()
install(DIRECTORY data/cameras data/expected data/grippers data/report data/rigs data/scenarios data/scenes data/sensors data/sites data/field_test
  DESTINATION ${CMAKE_INSTALL_DATADIR}/graspmap)
install(DIRECTORY pipelines DESTINATION ${CMAKE_INSTALL_DATADIR}/graspmap)
install(FILES tools/completion/graspmap.bash
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME graspmap)
# Manual pages of scripts/package.
install(DIRECTORY ${PROJECT_BINARY_DIR}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 OPTIONAL)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})

set(graspmap_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/graspmap)
install(EXPORT graspmap_targets NAMESPACE graspmap:: DESTINATION ${graspmap_cmake_folder}
  COMPONENT development)
configure_package_config_file(cmake/graspmapConfig.cmake.in
  ${PROJECT_BINARY_DIR}/graspmapConfig.cmake INSTALL_DESTINATION ${graspmap_cmake_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/graspmapConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/graspmapConfig.cmake
  ${PROJECT_BINARY_DIR}/graspmapConfigVersion.cmake DESTINATION ${graspmap_cmake_folder}
  COMPONENT development)
