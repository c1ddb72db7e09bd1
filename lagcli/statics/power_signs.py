"""The signs of a function about zero, by the powers that are known of it on rays.

Of one variable the first power decides, of two Newton's polygon: on a branch b = s a^w, a > 0, the terms of least
weight i + w j of sum C_ij a^i b^j decide; the slopes w are those of the polygon's edges, and the terms on an edge are a
polynomial of s. Where this touches zero, the branch b = s a^w + b' goes on with the slopes beyond w (Newton, Puiseux).

Of more variables one after another gets a weight, as large as a term allows that holds those without one, and the terms
of weight one decide, by their bounds on the sides of a box, which are halved.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from fractions import Fraction
from math import comb

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions, rank
from lagcli.statics import rest_equations

# (i, j) -> the coefficient of a^i b^j and its rounding.
Terms = Mapping[tuple[Fraction, int], tuple[float, float]]


@dataclasses.dataclass(frozen=True, slots=True)
class PowerSigns:
    """True for each: a function rises from zero, falls from zero, and no direction is left open."""

    rises: bool
    falls: bool
    is_decided: bool

    def __or__(self, other: PowerSigns) -> PowerSigns:
        return PowerSigns(
            self.rises or other.rises, self.falls or other.falls, self.is_decided and other.is_decided
        )


def of_powers(rays: Floats, forms: Floats, roundings: Floats, power: int) -> tuple[PowerSigns, PowerSigns]:
    """The signs on both sides of zero, by `forms` (rays, orders) of s, s^2, .. on rays (rays, k), 0 below `power`."""
    k, form, rounding = rays.shape[1], forms[:, power - 1], roundings[:, power - 1]
    seen = PowerSigns(bool((form > rounding).any()), bool((form < -rounding).any()), k == 1)
    if power % 2 or (seen.rises and seen.falls):
        seen = PowerSigns(True, True, True)
    if seen.is_decided or len(rays) <= power:
        return seen, seen
    return (_of_two if k == 2 else _of_many)(rays, forms, roundings, power)


def _of_two(rays: Floats, forms: Floats, roundings: Floats, power: int) -> tuple[PowerSigns, PowerSigns]:
    """The signs by Newton's polygon, with b along the direction on which the first form is largest on the circle.

    Of a power of a linear function all other terms vanish then. Beside that direction, as on a ray, they are small in
    turn, and the last of them, which decides the signs, is lost in rounding before the one above it is.
    """
    form, rounding, orders = forms[:, power - 1], roundings[:, power - 1], forms.shape[1]
    b = rays[int(np.argmax(np.abs(form)))]
    axes = np.column_stack([[b[1], -b[0]], b])
    exponents, values, _ = _coefficients(rays @ axes, form, rounding, power)
    P = np.zeros(power + 1)  # the form at (s, 1)
    P[[i for i, _ in exponents]] = values
    s = np.polynomial.Polynomial(P)
    # P(s) / (1 + s^2)^(power/2) is flat where it is largest: between the rays beside this one.
    x, slope = np.polynomial.Polynomial([0, 1]), s.deriv()
    flat = slope + np.polynomial.Polynomial([0, 0, 1]) * slope - power * x * s
    roots = np.polynomial.Polynomial(flat.coef[: power + 1]).roots()
    real = roots.real[np.imag(roots) == 0]
    # There is none where the form is the same all around.
    nearest = float(real[int(np.argmin(np.abs(real)))]) if real.size else 0.0
    turn = 1 / np.hypot(1.0, nearest) * np.array([[1.0, nearest], [-nearest, 1.0]])
    turned = rays @ np.asarray(axes @ turn)
    sides: list[dict[tuple[Fraction, int], tuple[float, float]]] = [{}, {}]
    for order in range(power, orders + 1):
        exponents, values, floors = _coefficients(turned, forms[:, order - 1], roundings[:, order - 1], order)
        for (i, j), value, floor in zip(exponents, values.tolist(), floors.tolist(), strict=True):
            sides[0][Fraction(i), j] = value, floor
            sides[1][Fraction(i), j] = value * (-1) ** i, floor
    for terms in sides:
        terms[Fraction(1), power - 1] = 0.0, 0.0  # by the choice of the axes, but for their own rounding
    above, below = (_signs(terms, Fraction(0), orders) for terms in sides)
    return above, below


def _of_many(rays: Floats, forms: Floats, roundings: Floats, power: int) -> tuple[PowerSigns, PowerSigns]:
    """The signs by the terms of weight one: where these leave them open, nothing is decided.

    Weights of variables that the first form does not hold are as large as the terms allow in which they stand: along
    b = s t^w all other terms are smaller.
    """
    k, most = rays.shape[1], power
    while most < forms.shape[1] and comb(most + k, k - 1) <= len(rays):
        most += 1
    rises = bool((forms[:, power - 1] > roundings[:, power - 1]).any())
    seen = PowerSigns(rises, not rises, False)
    if comb(power + k - 1, k - 1) > len(rays):
        return seen, seen
    weights: list[Fraction] = []
    turned = rays
    while len(weights) < k:
        terms = _clear_terms(turned, forms, roundings, range(power, most + 1))
        known = len(weights)
        slopes = {
            at: Fraction(1 - sum(w * i for w, i in zip(weights, at[:known], strict=True))) / sum(at[known:])
            for at in terms
            if any(at[known:])
        }
        slope = max(slopes.values(), default=Fraction(0))
        if slope * most < 1:  # powers that are not known may be as large
            return seen, seen
        edge = {at: terms[at][0] for at, each in slopes.items() if each == slope}
        sizes, axes = decompositions.axes(_gradients(edge, turned)[:, known:])
        count = int((sizes > rank.PARAMETERS.large * sizes[0]).sum())
        weights += [slope] * count
        turned = np.hstack([turned[:, :known], turned[:, known:] @ axes.T])
    terms = _clear_terms(turned, forms, roundings, range(power, most + 1))
    heights = {at: sum(w * i for w, i in zip(weights, at, strict=True)) for at in terms}
    face = {at: pair for at, pair in terms.items() if heights[at] == 1}
    pure = [face.get(tuple(int(1 / w) * (i == j) for j in range(k))) for i, w in enumerate(weights)]
    is_odd = any(sum(at) % 2 for at in face)
    found = seen
    if all(pair is not None and (pair[0] > 0) == rises for pair in pure):
        # Each variable is measured by its own power.
        units = [abs(pair[0]) ** -float(w) for pair, w in zip(pure, weights, strict=True) if pair is not None]
        found = _on_box(face, units, seen, is_odd)
    elif any(pair is not None and ((pair[0] > 0) != rises) for pair in pure) or is_odd:
        found = PowerSigns(True, True, True)
    return found, dataclasses.replace(found, falls=not found.falls) if is_odd and found.falls else found


def _clear_terms(
    rays: Floats, forms: Floats, roundings: Floats, orders: range
) -> dict[tuple[int, ...], tuple[float, float]]:
    """The exponents of all monomials whose coefficients are more than rounding, with these and their rounding."""
    found: dict[tuple[int, ...], tuple[float, float]] = {}
    for order in orders:
        exponents, values, floors = _coefficients(rays, forms[:, order - 1], roundings[:, order - 1], order)
        # The axes have a rounding of their own.
        floors = floors + doubles.SUM * float(np.abs(values).max(initial=0.0))
        found |= {
            at: (value, floor)
            for at, value, floor in zip(exponents, values.tolist(), floors.tolist(), strict=True)
            if abs(value) > floor
        }
    return found


def _gradients(terms: Mapping[tuple[int, ...], float], points: Floats) -> Floats:
    """The gradients (points, k) of a sum of monomials at points (points, k)."""
    exponents, c = np.array(list(terms)), np.array(list(terms.values()))
    found = []
    for own in np.eye(points.shape[1], dtype=int):
        lower = np.maximum(exponents - own, 0)
        found.append(np.prod(points[:, None, :] ** lower, axis=2) @ (c * (exponents @ own)))
    return np.column_stack(found)


def _on_box(
    face: Mapping[tuple[int, ...], tuple[float, float]], units: list[float], seen: PowerSigns, is_odd: bool
) -> PowerSigns:
    """The signs of a sum of monomials of weight one on the sides of a box, where each way from zero meets them once."""
    exponents, k = np.array(list(face)), len(units)
    sign = 1.0 if seen.rises else -1.0
    scale = np.prod(np.array(units) ** exponents, axis=1)
    c = sign * np.array([value for value, _ in face.values()]) * scale
    floor = float(np.array([rounding for _, rounding in face.values()]) @ scale)
    terms = dict(zip(face, c.tolist(), strict=True))
    seconds = []
    for (i, own), (j, other) in itertools.product(enumerate(np.eye(k, dtype=int)), repeat=2):
        factors = np.abs(c) * (exponents @ own) * ((exponents - own) @ other)
        seconds.append((i, j, np.maximum(exponents - own - other, 0), factors))
    sides = [(i, side) for i in range(k) for side in ((1.0, -1.0) if is_odd else (1.0,))]
    left = 40_000  # boxes that are looked at
    for axis, side in sides:
        centers, half = side * np.eye(k)[axis][None], 1.0
        wide = np.array([0.0 if i == axis else 1.0 for i in range(k)])
        steps = np.array(list(itertools.product(*([(0.0,) if not w else (-0.5, 0.5) for w in wide]))))
        while len(centers):
            left -= len(centers)
            if left < 0:
                return seen
            values = np.prod(centers[:, None, :] ** exponents, axis=2) @ c
            if (values < -floor).any():
                return PowerSigns(True, True, True)
            change = half * np.abs(_gradients(terms, centers)) @ wide
            reach = np.abs(centers) + half * wide
            for i, j, lower, factors in seconds:
                if wide[i] and wide[j]:
                    bound = np.prod(reach[:, None, :] ** lower, axis=2) @ np.maximum(factors, 0.0)
                    change += half**2 / 2 * bound
            open_ones = centers[~(values - change > floor)]
            centers = (open_ones[:, None, :] + half * steps[None]).reshape(-1, k)
            half /= 2
    return dataclasses.replace(seen, is_decided=True)


def _coefficients(
    rays: Floats, form: Floats, rounding: Floats, power: int
) -> tuple[list[tuple[int, ...]], Floats, Floats]:
    """The exponents of a form's monomials, their coefficients and the rounding of these, by its values on rays."""
    every = itertools.product(range(power + 1), repeat=rays.shape[1])
    exponents = [each for each in every if sum(each) == power]
    monomials = np.prod(rays[:, None, :] ** np.array(exponents), axis=2)
    inverse = decompositions.pseudo_inverse(monomials)
    return exponents, inverse @ form, np.abs(inverse) @ rounding


def _signs(terms: Terms, slope: Fraction, orders: int) -> PowerSigns:
    """The signs on branches with slopes above this one."""
    clear = {at for at, (value, rounding) in terms.items() if abs(value) > rounding}
    if not clear:
        return PowerSigns(False, False, False)
    i, j = min(clear, key=lambda at: (at[0] + slope * at[1], at[1]))
    if not j or (j % 2 and slope):
        return PowerSigns(False, False, False)  # what was taken for zero is none
    found = PowerSigns(False, False, True)
    while j:
        below = {at: (at[0] - i) / (j - at[1]) for at in clear if at[1] < j and at[0] > i}
        if not below:
            return found | PowerSigns(False, False, False)
        slope = min(below.values())
        weight = i + slope * j
        if weight >= orders + 1:  # powers that are not known may be as large
            return found | PowerSigns(False, False, False)
        on_edge = {at[1]: terms[at] for at in terms if at[0] + slope * at[1] == weight and at[1] <= j}
        first = min(at[1] for at, each in below.items() if each == slope)
        if first % 2 or j % 2:
            return found | PowerSigns(True, True, True)
        # The signs on the branches of the edge, sum c_j s^j, and where it touches zero those of the branches beyond
        c, e = np.zeros((2, j + 1 - first))
        for power, pair in on_edge.items():
            if power >= first:
                c[power - first], e[power - first] = pair
        found |= PowerSigns(bool(c[0] > 0 or c[-1] > 0), bool(c[0] < 0 or c[-1] < 0), True)
        touched: list[float] = []
        # Zeros of the odd derivatives, of the highest first: where a polynomial touches zero to the fourth power the
        # third derivative has a single zero.
        slopes = (np.polynomial.polynomial.polyder(c, k) for k in range(c.size - 1 - c.size % 2, 0, -2))
        roots = (np.polynomial.polynomial.polyroots(each).real.tolist() for each in slopes if each.size > 1)
        for s in itertools.chain.from_iterable(roots):
            powers = s ** np.arange(c.size)
            value, floor = float(c @ powers), float(e @ np.abs(powers))
            if abs(value) > floor:
                found |= PowerSigns(value > 0, value < 0, True)
            elif not any(abs(s - other) <= rest_equations.SMALL * abs(s) for other in touched):
                touched.append(s)
                found |= _signs(_shifted(terms, s, slope), slope, orders)
        if found.rises and found.falls:
            return found
        i, j = weight - slope * first, first
    return found


def _shifted(terms: Terms, s: float, slope: Fraction) -> Terms:
    """The terms with b = s a^slope + b'."""
    found: dict[tuple[Fraction, int], list[float]] = {}
    for (i, j), (value, rounding) in terms.items():
        for k in range(j + 1):
            factor = comb(j, k) * s ** (j - k)
            entry = found.setdefault((i + slope * (j - k), k), [0.0, 0.0])
            entry[0] += value * factor
            entry[1] += (rounding + doubles.SUM * abs(value)) * abs(factor)
    return {at: (value, rounding) for at, (value, rounding) in found.items()}
