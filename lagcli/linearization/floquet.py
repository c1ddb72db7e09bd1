"""The period of a motion, and the multipliers of deviations over it (Floquet).

Two instants are the same where velocities and all entries of the linear equations are: an angle may have turned once.
Deviations are carried along by the equations of motion and their exact derivatives, integrated together.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Complex, Floats
from lagcli.compiled import NumericSystem
from lagcli.linear import decompositions, rank
from lagcli.linearization import spectrum
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.smoothness.sized_function import SizedFunction

Signature = Callable[[float], Floats]

RTOL, ATOL = 1e-12, 1e-14  # as tight as DOP853 goes: over a period errors grow
# Times that are looked at in a span, and decades of the spans, the longest of which is the time allowed.
TIMES, DECADES = 400, 3
# Instants, in parts of a span, at which what comes back must do so; a return to the second of them is looked for.
INSTANTS = (0.0173, 0.1379, 0.3813)
# A return is one that comes this near, as a part of the way between.
CLOSED = rank.PARAMETERS.small
# Roundings of the time at which a return is found.
REFINEMENTS = 60


class FollowedMotion:
    """A motion from a state, by the functions of its independent rows."""

    def __init__(self, functions: LinearizedFunctions, numeric: NumericSystem, here: Reference) -> None:
        self.functions, self.numeric, self.here = functions, numeric, here
        self._n, self._begin = here.q.size, np.concatenate([here.q, here.v])
        self._units = [float(np.abs(x).max(initial=0.0)) or 1.0 for x in (here.v, functions.values(here))]
        sizes = [float(np.abs(part).max(initial=0.0)) or 1.0 for part in (here.q, here.v)]
        self._atol = ATOL * np.repeat(sizes, self._n)

    def rate(self, t: float, y: Floats) -> Floats:
        """y' of y = (q, v)."""
        found = self.numeric.rhs(t, np.concatenate([y, [0.0]]), self.here.p)
        return np.array(found).ravel()[: 2 * self._n]

    def reference(self, t: float, y: Floats) -> Reference:
        """The instant of a state, with its accelerations and multipliers."""
        rate, lam = self.numeric.solved(t, np.concatenate([y, [0.0]]), self.here.p)
        n = self._n
        a, lam = np.array(rate).ravel()[n : 2 * n], np.array(lam).ravel()
        return Reference(t, y[:n], y[n:], a, lam, self.here.p)

    def path(self, length: float) -> Callable[[float], Floats] | None:
        """The states y at times after the start, or None where the motion stops before."""
        from scipy import integrate

        t = self.here.t
        span, tolerance = (t, t + length), {"rtol": RTOL, "atol": self._atol}
        found = integrate.solve_ivp(self.rate, span, self._begin, "DOP853", dense_output=True, **tolerance)
        if not found.success:
            return None
        return lambda s: np.asarray(found.sol(t + s))

    def is_steady(self, length: float) -> bool:
        """True if kinetic energy and the sizes of forces stay the same for a time: it is steady seen otherwise."""
        path = self.path(length)
        if path is None:
            return False
        values = []
        for s in np.linspace(0.0, length, 9):
            here = self.reference(self.here.t + s, path(s))
            M = np.array(self.numeric.inertia(here.t, here.q, here.v, here.p))
            values.append(np.concatenate([[here.v @ M @ here.v, here.a @ M @ here.a], here.lam]))
        spread = np.abs(np.array(values) - values[0]).max(axis=0)
        return bool((spread <= doubles.ZERO * np.abs(values[0]).max()).all())

    def signature(self, path: Callable[[float], Floats], s: float) -> Floats:
        """Velocities and the entries of the linear equations at a time after the start, of one size."""
        here = self.reference(self.here.t + s, path(s))
        speed, entries = self._units
        return np.concatenate([here.v / speed, self.functions.values(here) / entries])

    def cycle(self, T: float) -> tuple[Complex, Complex]:
        """The multipliers (k,) over a period T, those that are 1 first, and their deviations dq (k, n) at the start."""
        from scipy import integrate

        linear, n, t0 = self.functions.at(self.here), self._n, self.here.t
        B, A, D, D_holonomic = (part.toarray() for part in (linear.B, linear.A, linear.D, linear.D_holonomic))
        # An orthonormal basis of the deviations of (q, v) that the rows allow, in units of T, in which speeds are of
        # the size of positions
        positions = np.hstack([B, np.zeros_like(B)])
        speeds = np.hstack([np.vstack([D_holonomic, D]), np.vstack([B[: len(D_holonomic)], A]) / T])
        basis = rank.null_basis(decompositions.unit(np.vstack([positions, speeds])))
        basis[n:] /= T
        deviations = decompositions.orthonormal(basis)[0]
        # The same a period later
        k = deviations.shape[1]
        t, y, W = ca.MX.sym("t"), ca.MX.sym("y", 2 * n), ca.MX.sym("dy", 2 * n, k)
        rate = self.numeric.rhs(t, ca.vertcat(y, 0), self.here.p)[: 2 * n]
        further = ca.jtimes(rate, y, W) if k else ca.MX(2 * n, 0)
        both, their_rates = ca.vertcat(y, ca.vec(W)), ca.vertcat(rate, ca.vec(further))
        function = SizedFunction("variation", [t, both], [their_rates])
        sizes = np.abs(deviations).max(axis=0)
        end = integrate.solve_ivp(
            lambda t, x: np.array(function(t, x)).ravel(),
            (t0, t0 + T),
            np.concatenate([self._begin, deviations.T.ravel()]),
            "DOP853",
            t_eval=[t0 + T],
            rtol=RTOL,
            atol=np.concatenate([self._atol, np.repeat(ATOL * sizes, 2 * n)]),
        )
        carried = deviations.T @ np.asarray(end.y[2 * n :, -1]).reshape(k, 2 * n).T
        found = spectrum.deflate(carried - np.eye(k), doubles.ZERO * float(np.linalg.norm(carried, 2)))
        values, vectors = np.linalg.eig(found.rest)
        others = 1 + values
        order = np.lexsort((-np.round(others.imag, 9), -np.round(np.abs(others), 9)))
        shapes = np.zeros((len(found.null), 0), dtype=complex)
        if values.size:
            shapes = found.full_vectors(values.astype(complex), vectors.astype(complex))
        every = np.hstack([found.null.astype(complex), shapes[:, order]])
        multipliers = np.concatenate([np.ones(found.zeros, dtype=complex), others[order]])
        return multipliers, (deviations[:n] @ every).T


def period(signature: Signature, longest: float) -> float | None:
    """The period T <= longest / 2 of a function of time, or None, by returns through the plane across its direction
    that are returns at other instants too."""
    from scipy import optimize

    for decade in range(DECADES, -1, -1):
        times = np.linspace(0.0, 10.0**-decade * longest / 2, TIMES)
        values = np.array([signature(t) for t in times])
        size = float(np.abs(values - values[0]).max(initial=0.0))
        if not size or not np.isfinite(values).all():
            continue
        # A generic instant: at the first one a derivative may vanish.
        begin = int(INSTANTS[1] * TIMES)
        here, ahead = values[begin], values[begin + 1] - values[begin - 1]
        along = (values - here) @ ahead

        def way(t: float, here: Floats = here, ahead: Floats = ahead) -> float:
            return float((signature(t) - here) @ ahead)

        for k in range(begin + 1, TIMES - 1):
            if not along[k] < 0 <= along[k + 1]:
                continue
            at = float(times[k])
            if way(at) != 0:
                at = optimize.brentq(way, at, times[k + 1], xtol=1e-300, rtol=4e-15, maxiter=REFINEMENTS)
            T = float(at - times[begin])
            again = [times[int(part * (TIMES - 1))] for part in INSTANTS]
            off = [signature(at) - here, *(signature(t + T) - signature(t) for t in again)]
            if np.abs(off).max() <= CLOSED * size:
                return T
    return None
