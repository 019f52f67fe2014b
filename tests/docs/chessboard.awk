# A chessboard of 9 x 7 squares of 30 mm with a white border, as a colored mesh (ASCII PLY, m).
BEGIN {
  s = 0.03
  for (j = -1; j < 8; ++j)
    for (i = -1; i < 10; ++i) {
      v = i < 0 || j < 0 || i > 8 || j > 6 || (i + j) % 2 ? 235 : 20
      for (k = 0; k < 4; ++k)
        vertices = vertices (i + (k % 3 > 0)) * s " " (j + (k > 1)) * s " 0 " v " " v " " v "\n"
      faces = faces "4 " 4 * n " " 4 * n + 1 " " 4 * n + 2 " " 4 * n + 3 "\n"
      ++n
    }
  print "ply\nformat ascii 1.0\nelement vertex " 4 * n "\nproperty float x\nproperty float y"
  print "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue"
  print "element face " n "\nproperty list uchar int vertex_indices\nend_header"
  printf "%s", vertices faces
}
