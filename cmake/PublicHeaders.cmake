# The public API: the headers that are installed. All other headers are private to this project.
set(graspmap_public_headers
  libgtd/detect.h)
