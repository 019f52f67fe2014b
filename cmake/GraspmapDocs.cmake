# Target `docs`: HTML of public headers and pages in build/.../docs/html, if Doxygen is installed.
# Warnings are errors.
find_program(DOXYGEN_PROGRAM doxygen)
if(DOXYGEN_PROGRAM)
  set(GRASPMAP_DOCS_FOLDER ${PROJECT_BINARY_DIR}/docs)
  # Equations use Debian's libjs-mathjax. Without it, a browser loads MathJax from the network.
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
