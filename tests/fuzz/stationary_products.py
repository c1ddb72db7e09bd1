"""`python -m tests.fuzz.stationary_products --problems 200 --polynomials 300 --mechanisms 100`: what `stationary` and
`equilibrium` find.

Problems are products of circles, spheres and planes, of which all solutions are known: told are the part of them that
is found, points that are none, and proofs that are wrong; with `--inexact` no proof is possible and the search is on
its own. Polynomials with rows and walls are held against an exact count: a sum t of the unknowns with odd weights, its
polynomial by elimination (SymPy), and the real roots of this. Mechanisms are brought to rest, and lambda and R held
against `simulate` started there.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math

import numpy as np
import sympy

import lagcli
from lagcli.statics.static_report import StaticPoint, StaticReport
from tests.helpers import statics_models

NEAR, RESIDUAL, SAME = 1e-9, 1e-11, 1e-8
NEAR_FORM = 1e-8  # of t, a sum of some numbers
PRIMES = (3, 5, 7, 11, 13, 17, 19, 23, 29, 31)


@dataclasses.dataclass
class Tally:
    wanted: int = 0
    found: int = 0
    false: int = 0
    proved: int = 0
    wrong_proofs: int = 0
    problems: int = 0


def judge(seed: int, tally: Tally, inexact: bool = False, starts: int = 32) -> None:
    """One problem."""
    problem = statics_models.problem(seed, inexact)
    found = lagcli.stationary(lagcli.loads(problem.text), problem.of, starts=starts)
    names = list(statics_models.names(len(problem.solutions[0])))
    hit = [
        any(statics_models.apart(p.at, names, place) <= NEAR for p in found) for place in problem.solutions
    ]
    false = [
        p
        for p in found
        if not any(statics_models.apart(p.at, names, place) <= NEAR for place in problem.solutions)
    ]
    tally.problems += 1
    tally.wanted += len(hit)
    tally.found += sum(hit)
    tally.false += len(false)
    tally.proved += found.complete
    tally.wrong_proofs += found.complete and (not all(hit) or bool(false))
    if not all(hit) or false:
        print(
            f"problem {seed}: {sum(hit)} of {len(hit)} found, {len(false)} false, complete {found.complete}",
            flush=True,
        )


@dataclasses.dataclass(frozen=True)
class Count:
    """The exact zeros of a polynomial problem: t of each, with its slacks s = +-sqrt(g) of walls; None where there are
    infinitely many, or too many to be counted here."""

    roots: tuple[float, ...] | None
    weights: tuple[int, ...]


def counted(problem: statics_models.Polynomial, primes: tuple[int, ...] = PRIMES) -> Count:
    """The zeros of grad f = sum lambda grad c, c = 0, g = s^2, lambda s = 0 by elimination."""
    names = statics_models.NAMES[: problem.n]
    x = sympy.symbols(names)
    f, rows, walls = (
        [sympy.nsimplify(sympy.sympify(text), rational=True) for text in texts]
        for texts in ([problem.of], problem.rows, problem.walls)
    )
    lam, s, t = sympy.symbols(f"l:{len(rows)}"), sympy.symbols(f"s:{len(walls)}"), sympy.Symbol("t")
    push = sympy.symbols(f"m:{len(walls)}")
    conditions = list(zip((*lam, *push), (*rows, *walls), strict=True))
    balance = [f[0].diff(q) - sum(factor * c.diff(q) for factor, c in conditions) for q in x]
    slack = [g - each**2 for g, each in zip(walls, s, strict=True)]
    slack += [factor * each for factor, each in zip(push, s, strict=True)]
    unknowns = (*s, *push, *lam, *x)
    weights = primes[: len(unknowns)]
    form = t - sum(w * u for w, u in zip(weights, unknowns, strict=True))
    basis = sympy.groebner([*balance, *rows, *slack, form], *unknowns, t, order="grevlex")
    if basis.exprs == [1]:
        return Count((), weights)
    if not basis.is_zero_dimensional:
        return Count(None, weights)
    eliminated = sympy.Poly(basis.fglm("lex").exprs[-1], t).sqf_part()
    return Count(
        tuple(float(root.evalf(25)) for root in eliminated.real_roots(multiple=False) for root in root[:1]),
        weights,
    )


def judge_polynomial(seed: int, starts: int = 8) -> tuple[list[str], bool]:
    """What is wrong with the points of one random polynomial problem, and whether they are told to be all."""
    problem = statics_models.polynomial(seed)
    found = lagcli.stationary(lagcli.loads(problem.text), problem.of, starts=starts)
    faults, is_complete = _against(problem, found, counted(problem))
    if faults:  # of two zeros the sums t may be one number: those of other weights are not
        faults, is_complete = _against(problem, found, counted(problem, PRIMES[::-1]))
    return faults, is_complete


def _against(problem: statics_models.Polynomial, found: StaticReport, exact: Count) -> tuple[list[str], bool]:
    """What is wrong with points by an exact count, and whether they are told to be all."""
    if exact.roots is None:
        return (["infinitely many, and told to be all"] if found.complete else []), found.complete
    left, faults = list(exact.roots), []
    for point in found:
        for t in forms(problem, point, exact.weights):
            near = min(left, key=lambda root: abs(root - t), default=math.inf)
            if abs(near - t) > NEAR_FORM * (1 + abs(t)):
                faults.append(f"twice or none: {dict(point.at)}")
                break
            left.remove(near)
        faults += wrong_type(problem, point)
    if found.complete and left:
        faults.append(f"{len(left)} of {len(exact.roots)} are missing")
    return faults, found.complete


def forms(problem: statics_models.Polynomial, point: StaticPoint, weights: tuple[int, ...]) -> list[float]:
    """The values of t at a point: for each sign of the slack of each wall that is not touched."""
    names = statics_models.NAMES[: problem.n]
    q = [point.at[name] for name in names]
    gaps = [float(sympy.sympify(wall).subs(dict(zip(names, q, strict=True)))) for wall in problem.walls]
    pushes = [point.multipliers[f"w{k}"] for k in range(len(gaps))]
    roots = [0.0 if push or gap < 1e-14 else math.sqrt(gap) for push, gap in zip(pushes, gaps, strict=True)]
    others = [*pushes, *(point.multipliers[f"r{k}"] for k in range(len(problem.rows))), *q]
    signs = itertools.product(*((1, -1) if root else (1,) for root in roots))
    return [
        sum(
            w * u
            for w, u in zip(
                weights, (*(a * b for a, b in zip(each, roots, strict=True)), *others), strict=True
            )
        )
        for each in signs
    ]


def wrong_type(problem: statics_models.Polynomial, point: StaticPoint) -> list[str]:
    """The type of a point without closed walls, where the curvatures along the rows are clear."""
    names = statics_models.NAMES[: problem.n]
    at = {name: point.at[name] for name in names}
    if any(point.multipliers[f"w{k}"] for k in range(len(problem.walls))):
        return []
    if any(abs(float(sympy.sympify(wall).subs(at))) < 1e-6 for wall in problem.walls):
        return []
    f, rows = sympy.sympify(problem.of), [sympy.sympify(row) for row in problem.rows]
    L = f - sum(point.multipliers[f"r{k}"] * row for k, row in enumerate(rows))
    x = sympy.symbols(names)
    H = np.array(sympy.hessian(L, x).subs(at), dtype=float)
    B = np.array([[row.diff(q).subs(at) for q in x] for row in rows], dtype=float).reshape(len(rows), len(x))
    _, sizes, Vt = np.linalg.svd(B)
    Z = Vt[int((sizes > 1e-9).sum()) :].T
    if not Z.shape[1]:
        return [] if point.type == "isolated" else [f"{point.type} for isolated"]
    curvatures = np.linalg.eigvalsh(Z.T @ H @ Z)
    if np.abs(curvatures).min() < 1e-5 * max(1.0, np.abs(H).max()):
        return []
    kind = "minimum" if curvatures[0] > 0 else "maximum" if curvatures[-1] < 0 else "saddle"
    return [] if point.type == kind else [f"{point.type} for {kind} at {at}"]


def judge_mechanism(seed: int) -> list[str]:
    """What is wrong with the points of rest of one mechanism."""
    model = lagcli.loads(statics_models.mechanism(seed))
    found = lagcli.equilibrium(model, starts=3)
    faults = [] if len(found) else ["nothing found"]
    for point in list(found)[:3]:
        if point.residual > RESIDUAL * (1 + max(map(abs, point.multipliers.values()), default=0.0)) * 100:
            faults.append(f"residual {point.residual:.1e}")
        faults += held_against_a_run(model, point)
    return faults


def held_against_a_run(model: lagcli.Model, point: StaticPoint) -> list[str]:
    """lambda and R of a run that starts at a point, at its first row, against those of the point."""
    from lagcli.equations import system

    q = np.array([point.at[name] for name in model.coordinate_names])
    there = system.started_at(model, q, np.zeros(q.size))
    try:
        run = lagcli.simulate(there, duration=1e-3, samples=2, assemble=False)
    except lagcli.SimulationStopped as stopped:  # the first row is there all the same
        run = stopped.trajectory
    pairs = {f"lambda.{name}": value for name, value in point.multipliers.items()} | dict(point.reactions)
    size = max([1.0, *map(abs, pairs.values())])
    return [
        f"{name}: {value!r} at rest, {run[name][0]!r} in a run"
        for name, value in pairs.items()
        if abs(run[name][0] - value) > SAME * size
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--polynomials", type=int, default=300)
    parser.add_argument("--mechanisms", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--inexact", action="store_true")
    chosen = parser.parse_args()
    tally = Tally()
    for seed in range(chosen.first, chosen.first + chosen.problems):
        judge(seed, tally, chosen.inexact)
    if tally.problems:
        print(f"{tally}: {tally.found / tally.wanted:.4f} found")
    proved = wrong = 0
    for seed in range(chosen.first, chosen.first + chosen.polynomials):
        faults, is_complete = judge_polynomial(seed)
        proved, wrong = proved + is_complete, wrong + bool(faults)
        for fault in faults:
            print(f"polynomial {seed}: {fault}", flush=True)
    print(f"{chosen.polynomials} polynomials, {proved} told to be complete, {wrong} faulty")
    faulty = 0
    for seed in range(chosen.first, chosen.first + chosen.mechanisms):
        faults = judge_mechanism(seed)
        faulty += bool(faults)
        for fault in faults:
            print(f"mechanism {seed}: {fault}", flush=True)
    print(f"{chosen.mechanisms} mechanisms, {faulty} faulty")


if __name__ == "__main__":
    main()
