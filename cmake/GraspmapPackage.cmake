# Debian packages by cpack. graspmap contains the program, its private libraries, data and pipelines;
# libgraspmap-dev the files for building against the libraries; python3-graspmap the Python module.
# scripts/package writes the manual pages and the compressed changelog first.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME graspmap)
# The builder of a package is its maintainer, as with dch.
if(DEFINED ENV{DEBEMAIL})
  set(CPACK_PACKAGE_CONTACT "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
else()
  cmake_host_system_information(RESULT host QUERY FQDN)
  set(CPACK_PACKAGE_CONTACT "graspmap developers <root@${host}>")
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY
  "graspability maps for robots that climb with spined grippers")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(package_text "graspmap turns a handheld RGB-D scan of rocky ground into a map of where a
spined gripper can hold, and checks that map. All stages run offline and
without a screen.
")
set(CPACK_COMPONENTS_ALL graspmap development)

set(CPACK_DEBIAN_GRASPMAP_PACKAGE_NAME graspmap)
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_SECTION science)
set(CPACK_COMPONENT_GRASPMAP_DESCRIPTION "${package_text}")
# dpkg-shlibdeps finds the linked libraries. The others provide fonts, rendering without a screen, the
# report's 3-D view and make for the pipelines.
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_LIBRARY_OUTPUT_DIRECTORY})
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_DEPENDS "fonts-dejavu-core, libgl1-mesa-dri, libjs-three, make, xvfb")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libgraspmap-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "graspmap (= ${PROJECT_VERSION}), libeigen3-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS cmake)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "${package_text}
This package has the public headers and the CMake package of the libraries.")

if(TARGET graspmap_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-graspmap)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "${package_text}
This package has the Python module, which runs the stages on NumPy
arrays.")
  # The extension module requires the Python version that it was built for.
  get_target_property(minor graspmap_python python_minor_version)
  math(EXPR next_minor "${minor} + 1")
  string(CONCAT CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "graspmap (= ${PROJECT_VERSION}), python3-numpy, "
    "python3 (>= 3.${minor}), python3 (<< 3.${next_minor})")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-matplotlib")
endif()
include(CPack)

# Debian's policy requires a copyright file and a changelog in each package (12.5, 12.7).
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(package_doc_folder share/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  install(FILES cmake/debian/copyright DESTINATION ${package_doc_folder} COMPONENT ${component})
  install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION ${package_doc_folder}
    COMPONENT ${component} OPTIONAL)
endforeach()
