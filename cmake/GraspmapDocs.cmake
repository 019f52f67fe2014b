# The target `docs`: public headers and pages as build/.../docs/html, by Doxygen where it is
# installed. A warning is an error.
find_program(DOXYGEN_PROGRAM doxygen)
if(DOXYGEN_PROGRAM)
  set(GRASPMAP_DOCS_FOLDER ${PROJECT_BINARY_DIR}/docs)
  # Equations: Debian's libjs-mathjax; without it a browser takes MathJax from the network.
  find_path(MATHJAX_FOLDER MathJax.js PATHS /usr/share/javascript/mathjax NO_DEFAULT_PATH)
  set(GRASPMAP_MATHJAX "")
  if(MATHJAX_FOLDER)
    set(GRASPMAP_MATHJAX "MATHJAX_RELPATH = ${MATHJAX_FOLDER}")
  endif()
  configure_file(${PROJECT_SOURCE_DIR}/cmake/Doxyfile.in ${PROJECT_BINARY_DIR}/Doxyfile @ONLY)
  file(MAKE_DIRECTORY ${GRASPMAP_DOCS_FOLDER})
  add_custom_target(docs COMMAND ${DOXYGEN_PROGRAM} ${PROJECT_BINARY_DIR}/Doxyfile
    COMMENT "Doxygen: ${GRASPMAP_DOCS_FOLDER}/html/index.html")
endif()
