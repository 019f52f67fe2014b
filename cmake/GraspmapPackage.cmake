# cpack: one Debian package of the program, the library, its headers and data. scripts/package makes
# the manual pages first.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME graspmap)
set(CPACK_PACKAGE_CONTACT "graspmap developers <graspmap@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
# Of what the programs link, by dpkg-shlibdeps; then what they start: VTK's pictures without a
# screen, and the pipelines.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_LIBRARY_OUTPUT_DIRECTORY})
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libgl1-mesa-dri, make, xvfb")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libjs-three")
# To build against the library.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "cmake, libeigen3-dev")
include(CPack)
