# cpack: a Debian package of the program, the library, its headers and data, and python3-graspmap, the
# module. scripts/package makes the manual pages first.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME graspmap)
set(CPACK_PACKAGE_CONTACT "graspmap developers <graspmap@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
# Of what the programs link, by dpkg-shlibdeps; then what they read and start: fonts, VTK's scenes
# without a screen, and the pipelines.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_LIBRARY_OUTPUT_DIRECTORY})
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_NAME graspmap)
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_DEPENDS "fonts-dejavu-core, libgl1-mesa-dri, libjs-three, make, xvfb")
# To build against the library.
set(CPACK_DEBIAN_GRASPMAP_PACKAGE_SUGGESTS "cmake, libeigen3-dev")
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL graspmap)
if(TARGET graspmap_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-graspmap)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "Python module of graspmap\n${PROJECT_DESCRIPTION}.")
  # The extension module is of one version of Python.
  get_target_property(minor graspmap_python python_minor_version)
  math(EXPR next_minor "${minor} + 1")
  string(CONCAT CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "graspmap (= ${PROJECT_VERSION}), python3-numpy, "
    "python3 (>= 3.${minor}), python3 (<< 3.${next_minor})")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-matplotlib")
endif()
include(CPack)
