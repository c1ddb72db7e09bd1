"""Andrews' squeezing mechanism from the matrices of the test set for IVP solvers, for a solver of its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]

START = [
    *[-0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550],
    *[-0.222668390165885885, 1.23054744454982119],
]
M1, M2, M3, M4, M5, M6, M7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
XB, YB, XC, YC, C0, L0, MOMENT = -0.03635, 0.03273, 0.014, 0.072, 4530.0, 0.07785, 33e-3
D, DA, E, EA, RR, RA, SS, SA, SB = 28e-3, 0.0115, 0.02, 0.01421, 7e-3, 9.2e-4, 35e-3, 0.01874, 0.01043
SC, SD, TA, TB, U, UA, UB, ZF, ZT, FA = (
    18e-3,
    0.02,
    0.02308,
    9.16e-3,
    0.04,
    0.01228,
    4.49e-3,
    0.02,
    0.04,
    0.01421,
)


def mass(q: Floats) -> Floats:
    """The mass matrix (7, 7)."""
    cth, sph, som = np.cos(q[1]), np.sin(q[3]), np.sin(q[5])
    found = np.diag([
        M1 * RA**2 + M2 * (RR**2 - 2 * DA * RR * cth + DA**2) + I1 + I2,
        M2 * DA**2 + I2,
        M3 * (SA**2 + SB**2) + I3,
        M4 * (E - EA) ** 2 + I4,
        M4 * (ZT**2 + 2 * ZT * (E - EA) * sph + (E - EA) ** 2) + M5 * (TA**2 + TB**2) + I4 + I5,
        M6 * (ZF - FA) ** 2 + I6,
        M6 * ((ZF - FA) ** 2 - 2 * U * (ZF - FA) * som + U**2) + M7 * (UA**2 + UB**2) + I6 + I7,
    ])  # fmt: skip
    found[0, 1] = found[1, 0] = M2 * (DA**2 - DA * RR * cth) + I2
    found[3, 4] = found[4, 3] = M4 * ((E - EA) ** 2 + ZT * (E - EA) * sph) + I4
    found[5, 6] = found[6, 5] = M6 * ((ZF - FA) ** 2 - U * (ZF - FA) * som) + I6
    return found


def force(q: Floats, v: Floats) -> Floats:
    """The right side (7,): torque, spring, and what is quadratic in the rates."""
    bep, thp, php, dep, omp, epp = v[0], v[1], v[3], v[4], v[5], v[6]
    siga, coga = np.sin(q[2]), np.cos(q[2])
    x, y = SD * coga + SC * siga + XB - XC, SD * siga - SC * coga + YB - YC
    length = np.hypot(x, y)
    pull = -C0 * (length - L0) / length
    arm = M2 * DA * RR * np.sin(q[1])
    fourth, sixth = M4 * ZT * (E - EA) * np.cos(q[3]), M6 * U * (ZF - FA) * np.cos(q[5])
    return np.array([
        MOMENT - arm * thp * (thp + 2 * bep),
        arm * bep**2,
        pull * (x * (SC * coga - SD * siga) + y * (SD * coga + SC * siga)),
        fourth * dep**2,
        -fourth * php * (php + 2 * dep),
        -sixth * epp**2,
        sixth * omp * (omp + 2 * epp),
    ])  # fmt: skip


def rows(q: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The derivatives (6, 7) of the six rows, of complex arguments too."""
    sine, cosine = np.sin, np.cos
    be, ga, de, ep = q[0], q[2], q[4], q[6]
    found = np.zeros((6, 7), dtype=np.complex128)
    found[::2, 0] = -RR * sine(be) + D * sine(be + q[1])
    found[::2, 1] = D * sine(be + q[1])
    found[1::2, 0] = RR * cosine(be) - D * cosine(be + q[1])
    found[1::2, 1] = -D * cosine(be + q[1])
    found[0, 2], found[1, 2] = -SS * cosine(ga), -SS * sine(ga)
    found[2, 3], found[3, 3] = -E * cosine(q[3] + de), -E * sine(q[3] + de)
    found[2, 4], found[3, 4] = found[2, 3] + ZT * sine(de), found[3, 3] - ZT * cosine(de)
    found[4, 5], found[5, 5] = ZF * sine(q[5] + ep), -ZF * cosine(q[5] + ep)
    found[4, 6], found[5, 6] = found[4, 5] - U * cosine(ep), found[5, 5] - U * sine(ep)
    return found


def accelerations(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Accelerations (7,) and multipliers (6,) of M a + G^T lambda = f, G a = -G' v."""
    tiny = 1e-30  # the complex step: nothing is subtracted
    turned = -(rows(q + 1j * tiny * v).imag / tiny) @ v
    jacobian = rows(q.astype(np.complex128)).real
    whole = np.block([[mass(q), jacobian.T], [jacobian, np.zeros((6, 6))]])
    found = np.linalg.solve(whole, np.concatenate([force(q, v), turned]))
    return found[:7], found[7:]


def multipliers(end: float = 0.03) -> Floats:
    """The multipliers (6,) at the end, by DOP853 on the accelerations."""
    start = np.concatenate([START, np.zeros(7)])
    found = solve_ivp(
        lambda _, y: np.concatenate([y[7:], accelerations(y[:7], y[7:])[0]]),
        (0.0, end), start, method="DOP853", rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    assert found.success
    return accelerations(found.y[:7, -1], found.y[7:, -1])[1]
