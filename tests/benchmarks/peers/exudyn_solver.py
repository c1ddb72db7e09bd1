"""Exudyn: rigid bodies and point masses with algebraic constraints, implicit integrators of order 2 in C++.

Chains and cloth are mass points with distance constraints, all in C++. The disk and the car axis have no item of
their own and are a generic body with user functions in Python. Its explicit integrators of higher order take no
constraints. The time is that of the solution alone, without building the system, without output.
"""

from __future__ import annotations

import functools
import itertools
import math
import sys
import time
from collections.abc import Callable
from typing import Any

sys.exudynFast = True  # type: ignore[attr-defined]  # the module without checks of ranges

import exudyn as exu  # noqa: E402
import numpy as np  # noqa: E402
import protocol  # noqa: E402
from exudyn import itemInterface  # noqa: E402

FIRST_STEPS = 250
DENSE_NODES = 20  # beyond, the sparse linear solver is faster
SCHEMES = {
    "index 2, trapezoidal": None,
    "index 3, radius 1": 1.0,
    "index 3, radius 0.9": 0.9,
}
NEWTON = {"full Newton": False, "modified Newton": True}
# The looser one is faster; the tighter one is for where it hides the order of the scheme.
TOLERANCES = (1e-10, 1e-13)
BEST = 3  # so many of the ways, best first, are tried to the end


def network(problem: dict[str, Any]) -> tuple[Any, Callable[[], Any]]:
    """Mass points and rods."""
    points = np.array(problem["points"])
    held = set(problem["held"])
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject(itemInterface.ObjectGround())
    markers = []
    for k, point in enumerate(points):
        if k in held:
            markers.append(
                mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=ground, localPosition=point))
            )
            continue
        node = mbs.AddNode(itemInterface.NodePoint(referenceCoordinates=point))
        body = mbs.AddObject(itemInterface.ObjectMassPoint(mass=1, nodeNumber=node))
        mass = mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=body))
        mbs.AddLoad(
            itemInterface.LoadMassProportional(markerNumber=mass, loadVector=[0, 0, -protocol.GRAVITY])
        )
        markers.append(mbs.AddMarker(itemInterface.MarkerNodePosition(nodeNumber=node)))
    for i, j in problem["rods"]:
        length = float(np.linalg.norm(points[i] - points[j]))
        pair = [markers[i], markers[j]]
        mbs.AddObject(itemInterface.ObjectConnectorDistance(markerNumbers=pair, distance=length))
    start = points[[k for k in range(len(points)) if k not in held]].ravel()
    return mbs, lambda: start + mbs.systemData.GetODE2Coordinates()


def generic(q: list[float], v: list[float]) -> tuple[Any, int, list[int]]:
    """A body of generic coordinates, its node and the two markers of a constraint on it."""
    mbs = exu.SystemContainer().AddSystem()
    node = mbs.AddNode(
        itemInterface.NodeGenericODE2(
            referenceCoordinates=[0.0] * len(q),  # some functions get coordinates with, some without them
            initialCoordinates=q,
            initialCoordinates_t=v,
            numberOfODE2Coordinates=len(q),
        )
    )
    ground = mbs.AddNode(itemInterface.NodePointGround())
    pair = [mbs.AddMarker(itemInterface.MarkerNodeCoordinates(nodeNumber=k)) for k in (ground, node)]
    return mbs, node, pair


def disk(problem: dict[str, Any]) -> tuple[Any, Callable[[], Any]]:
    """x, y, theta, phi; rows of velocity."""
    a, M = problem["a"], problem["M"]
    mass = [M, M, M * a**2 / 4, M * a**2 / 2]
    mbs, node, pair = generic([0.0] * 4, [0.0, -a * problem["spin"], problem["turn"], problem["spin"]])
    mbs.AddObject(itemInterface.ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.diag(mass)))

    def rows(_mbs: Any, _t: float, _item: int, q: Any, _v: Any, _level: bool) -> Any:
        return [[1, 0, 0, -a * math.sin(q[2])], [0, 1, 0, a * math.cos(q[2])]]

    def residual(_mbs: Any, _t: float, _item: int, q: Any, v: Any, _level: bool) -> Any:
        return [v[0] - a * math.sin(q[2]) * v[3], v[1] + a * math.cos(q[2]) * v[3]]

    mbs.AddObject(
        itemInterface.ObjectConnectorCoordinateVector(
            markerNumbers=pair,
            scalingMarker0=np.zeros((2, 3)),
            velocityLevel=True,
            constraintUserFunction=residual,
            jacobianUserFunction=rows,
        )
    )
    return mbs, lambda: mbs.systemData.GetODE2Coordinates()


def axis(problem: dict[str, Any]) -> tuple[Any, Callable[[], Any]]:
    """xl, yl, xr, yr; two rows, the first of them moved by the road.

    A user function of time alone does not give the derivatives that the integrators need, so time is a fifth
    coordinate, driven by t, and the rows are functions of the five.
    """
    L, L0, r, w, m = (problem[name] for name in ("L", "L0", "r", "w", "m"))
    mass = [m, m, m, m, 1.0]
    mbs, node, pair = generic([0, L0, L, L0, 0], [-L0 / L, 0, -L0 / L, 0, 1])

    def road(t: float) -> tuple[float, float]:
        yb = r * math.sin(w * t)
        return math.sqrt(L * L - yb * yb), yb

    def force(_mbs: Any, _t: float, _item: int, q: Any, _v: Any) -> Any:
        xl, yl, xr, yr, s = q
        xb, yb = road(s)
        left, right = math.hypot(xl, yl), math.hypot(xr - xb, yr - yb)
        kl, kr = (L0 - left) / left, (L0 - right) / right
        weight = m * problem["g"]
        return [kl * xl, kl * yl - weight, kr * (xr - xb), kr * (yr - yb) - weight, 0]

    def residual(_mbs: Any, _t: float, _item: int, q: Any, _v: Any, _level: bool) -> Any:
        xl, yl, xr, yr, s = q
        xb, yb = road(s)
        return [xl * xb + yl * yb, ((xl - xr) ** 2 + (yl - yr) ** 2 - L * L) / 2]

    def rows(_mbs: Any, _t: float, _item: int, q: Any, _v: Any, _level: bool) -> Any:
        xl, yl, xr, yr, s = q
        xb, yb = road(s)
        dyb = r * w * math.cos(w * s)
        dxb = -yb * dyb / xb
        return [[xb, yb, 0, 0, xl * dxb + yl * dyb], [xl - xr, yl - yr, xr - xl, yr - yl, 0]]

    mbs.AddObject(
        itemInterface.ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.diag(mass), forceUserFunction=force)
    )
    mbs.AddObject(
        itemInterface.ObjectConnectorCoordinateVector(
            markerNumbers=pair,
            scalingMarker0=np.zeros((2, 3)),
            constraintUserFunction=residual,
            jacobianUserFunction=rows,
        )
    )
    fixed = mbs.AddNode(itemInterface.NodePointGround())
    ground = mbs.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))
    clock = mbs.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=node, coordinate=4))
    mbs.AddObject(
        itemInterface.ObjectConnectorCoordinate(
            markerNumbers=[ground, clock],
            offsetUserFunction=lambda _mbs, t, _item, _offset: t,
            offsetUserFunction_t=lambda _mbs, _t, _item, _offset: 1.0,
        )
    )
    return mbs, lambda: mbs.systemData.GetODE2Coordinates()[:4]


BUILDERS: dict[str, Callable[[dict[str, Any]], tuple[Any, Callable[[], Any]]]] = {
    "network": network,
    "disk": disk,
    "axis": axis,
}


def solve(mbs: Any, way: tuple[str, str], steps: int, asked: tuple[float, float]) -> float:
    """Seconds of one run from the start; `asked` are duration and tolerance of Newton's iteration."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    chosen = settings.timeIntegration
    chosen.endTime, tolerance = asked
    chosen.numberOfSteps, chosen.adaptiveStep = steps, False
    chosen.newton.relativeTolerance = chosen.newton.absoluteTolerance = tolerance
    chosen.newton.useModifiedNewton = NEWTON[way[1]]
    if mbs.systemData.NumberOfNodes() > DENSE_NODES:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    kind, radius = exu.DynamicSolverType.TrapezoidalIndex2, SCHEMES[way[0]]
    if radius is not None:
        kind = exu.DynamicSolverType.GeneralizedAlpha
        chosen.generalizedAlpha.spectralRadius = radius
    began = time.perf_counter()
    mbs.SolveDynamic(settings, solverType=kind)
    return time.perf_counter() - began


def main() -> None:
    """Answer one request: the ways that are most accurate for their time, with as many steps as it takes."""
    asked = protocol.request()
    problem = asked["problem"]
    began = time.perf_counter()
    mbs, end = BUILDERS[problem["kind"]](problem)
    mbs.Assemble()
    search = protocol.Search(asked, time.perf_counter() - began)

    def run(way: tuple[str, str], tolerance: float, steps: int) -> tuple[float, Any]:
        try:
            return solve(mbs, way, steps, (problem["duration"], tolerance)), np.array(end())
        except exu.SolverError:  # a way that does not converge at this step is not the one to take
            return 0.0, np.full(len(asked["reference"]), np.nan)

    costs = {}
    for way in itertools.product(SCHEMES, NEWTON):
        trial = functools.partial(run, way, TOLERANCES[0], FIRST_STEPS)
        seconds, reached = search.attempt(f"{', '.join(way)}, {FIRST_STEPS} steps", trial)
        if np.isfinite(reached):
            costs[way] = seconds * reached**0.5
        if search.left() < 0:
            return
    for way in sorted(costs, key=lambda way: costs[way])[:BEST]:
        steps, is_over = 2 * FIRST_STEPS, False
        for tolerance in TOLERANCES:
            steps, is_over = search.by_steps(", ".join(way), functools.partial(run, way, tolerance), steps)
            if is_over:
                return


if __name__ == "__main__":
    main()
