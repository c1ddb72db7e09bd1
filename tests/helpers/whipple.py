"""The bicycle of Meijaard, Papadopoulos, Ruina and Schwab (2007): its model, and its linear equations as published."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# Nine coordinates, two holonomic and four differential rows; parameters of Table 1, rolling straight on at v.
MODEL = """\
lagcli: 1
parameters:
  w: 1.02
  c: 0.08
  tilt: pi/10
  g: 9.81
  rR: 0.3
  rF: 0.35
  v: 3
  sl: sin(tilt)
  cl: cos(tilt)
coordinates:
  X: {value: 0, rate: v}
  Y: {value: 0, rate: 0}
  Z: {value: -rR, rate: 0}
  psi: {value: 0, rate: 0}
  phi: {value: 0, rate: 0}
  chi: {value: 0, rate: 0}
  del: {value: 0, rate: 0}
  thR: {value: 0, rate: -v/rR}
  thF: {value: 0, rate: -v/rF}
definitions:
  e1: >-
    [cos(psi)*cos(chi) - sin(psi)*sin(phi)*sin(chi), sin(psi)*cos(chi) + cos(psi)*sin(phi)*sin(chi),
    -cos(phi)*sin(chi)]
  e2: "[-sin(psi)*cos(phi), cos(psi)*cos(phi), sin(phi)]"
  e3: >-
    [cos(psi)*sin(chi) + sin(psi)*sin(phi)*cos(chi), sin(psi)*sin(chi) - cos(psi)*sin(phi)*cos(chi),
    cos(phi)*cos(chi)]
  s11: 1 - (1-cos(del))*cl**2
  s12: -cl*sin(del)
  s13: (1-cos(del))*sl*cl
  s21: cl*sin(del)
  s22: cos(del)
  s23: -sl*sin(del)
  s31: (1-cos(del))*sl*cl
  s32: sl*sin(del)
  s33: 1 - (1-cos(del))*sl**2
  h1: s11*e1 + s21*e2 + s31*e3
  h2: s12*e1 + s22*e2 + s32*e3
  h3: s13*e1 + s23*e2 + s33*e3
  wx: -rate(psi)*sin(chi)*cos(phi) + rate(phi)*cos(chi)
  wy: rate(psi)*sin(phi) + rate(chi)
  wz: rate(psi)*cos(chi)*cos(phi) + rate(phi)*sin(chi)
  hx: s11*wx + s21*wy + s31*wz + sl*rate(del)
  hy: s12*wx + s22*wy + s32*wz
  hz: s13*wx + s23*wy + s33*wz + cl*rate(del)
  OR: wx*e1 + (wy + rate(thR))*e2 + wz*e3
  OF: hx*h1 + (hy + rate(thF))*h2 + hz*h3
  nR: sqrt(1 - sin(phi)**2)
  n3: s12*(-cos(phi)*sin(chi)) + s22*sin(phi) + s32*cos(phi)*cos(chi)
  nF: sqrt(1 - n3**2)
  cR: rR/nR*([0, 0, 1] - sin(phi)*e2)
  cF: rF/nF*([0, 0, 1] - n3*h2)
particles:
  rear: {mass: 2, position: [X, Y, Z]}
  B: {mass: 85, position: "[X, Y, Z] + 0.3*e1 + (-0.9 + rR)*e3"}
  H: {mass: 4, position: "[X, Y, Z] + (w+c)*e1 + rR*e3 + (0.9-w-c)*h1 - 0.7*h3"}
  front: {mass: 3, position: "[X, Y, Z] + (w+c)*e1 + rR*e3 - c*h1 - rF*h3"}
lagrangian: >-
  0.0603*(wx**2 + wz**2)/2 + 0.12*(wy + rate(thR))**2/2
  + (9.2*wx**2 + 11*wy**2 + 2.8*wz**2)/2 + 2.4*wx*wz
  + (0.05892*hx**2 + 0.06*hy**2 + 0.00708*hz**2)/2 - 0.00756*hx*hz
  + 0.1405*(hx**2 + hz**2)/2 + 0.28*(hy + rate(thF))**2/2
forces:
  weight: {to: all, force: [0, 0, m*g]}
holonomic:
  touch_R: Z + rR*nR = 0
  touch_F: front.z + rF*nF = 0
differential:
  rear_x: dot([1, 0, 0], [rate(X), rate(Y), rate(Z)] + cross(OR, cR)) = 0
  rear_y: dot([0, 1, 0], [rate(X), rate(Y), rate(Z)] + cross(OR, cR)) = 0
  front_x: dot([1, 0, 0], front.v + cross(OF, cF)) = 0
  front_y: dot([0, 1, 0], front.v + cross(OF, cF)) = 0
"""
# M q'' + v C1 q' + (g K0 + v^2 K2) q = 0 in lean and steer, with the numbers of their section 4(b).
M = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
C1 = np.array([[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
K0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
K2 = np.array([[0, 76.59734589573222], [0, 2.65431523794604]])


def eigenvalues(v: float, g: float = 9.81) -> npt.NDArray[np.complex128]:
    """The four eigenvalues of lean and steer at a speed, by imaginary parts."""
    stiffness, damping = np.linalg.solve(M, g * K0 + v**2 * K2), np.linalg.solve(M, v * C1)
    top = np.hstack([np.zeros((2, 2)), np.eye(2)])
    return np.sort_complex(np.linalg.eigvals(np.vstack([top, np.hstack([-stiffness, -damping])])))
