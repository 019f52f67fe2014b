# Limits of the gravito-inertial acceleration of a robot that holds at three footholds
# (Ribeiro et al., "Dynamic Equilibrium of Climbing Robots Based on Stability Polyhedron for
# Gravito-Inertial Acceleration", CLAWAR 2020; ClimbLab's gia_limit): about the axis through the
# footholds a and b, the robot tumbles when
#   m a_gi . n > F_j . ((p_b - p_j) x (p_a - p_j)),   n = (p_g - p_a) x (p_g - p_b),
# with mass m, acceleration a_gi, footholds p_a, p_b, p_j, and center of mass p_g. F_j is the downward
# force that the gripper at the third foothold j holds (pull_away_n).
# Input: a table of `graspmap footholds --mesh`. The first three footholds are used.
# Variables: mass (kg), height (height of the center of mass above the footholds' mean, m).
BEGIN { FS = "," }
NR == 1 { for (n = 1; n <= NF; ++n) column[$n] = n; next }
NR <= 4 {
  k = NR - 2
  for (d = 0; d < 3; ++d) {
    p[k, d] = $column[substr("xyz", d + 1, 1)]
    g[d] += p[k, d] / 3 + (d == 2 ? height / 3 : 0)
  }
  force[k] = $column["pull_away_n"]
}
function cross(i, j, ox, oy, oz) {  # (p_i - o) x (p_j - o) into c
  c[0] = (p[i, 1] - oy) * (p[j, 2] - oz) - (p[i, 2] - oz) * (p[j, 1] - oy)
  c[1] = (p[i, 2] - oz) * (p[j, 0] - ox) - (p[i, 0] - ox) * (p[j, 2] - oz)
  c[2] = (p[i, 0] - ox) * (p[j, 1] - oy) - (p[i, 1] - oy) * (p[j, 0] - ox)
}
END {
  for (j = 0; j < 3; ++j) {
    a = (j + 1) % 3; b = (j + 2) % 3
    cross(b, a, p[j, 0], p[j, 1], p[j, 2])
    if (c[2] > 0) { a = (j + 2) % 3; b = (j + 1) % 3 }  # the downward force resists
    moment = force[j] * (c[2] > 0 ? c[2] : -c[2])
    cross(a, b, g[0], g[1], g[2])  # (p_a - p_g) x (p_b - p_g) = n
    length_n = sqrt(c[0] ^ 2 + c[1] ^ 2 + c[2] ^ 2)
    limit = moment / (mass * length_n)
    printf "axis %d-%d: limit %.1f m/s2, margin under gravity %.1f m/s2\n", a + 1, b + 1, limit,
      limit + 9.81 * c[2] / length_n
  }
}
