"""The functions that the texts of a model name: what none of them can bring about is not looked for, nor loaded."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from lagcli.expression import functions
from lagcli.model import model as nouns

ANGLES = functions.calls(functions.named(lambda row: row.period > 0.0))
_SWITCHES = functions.calls(functions.named(lambda row: row.is_piecewise))
# A power whose exponent is not whole may be a root, and so a modulus.
POWERS = r"\*\*(?!\s*[-+]?\d+(?![\w.]))"
_JUMPS = re.compile(rf"{functions.calls(functions.named(lambda row: row.may_jump)).pattern}|{POWERS}")
# A length jumps like a modulus where it is divided by, or divides, what changes its sign: not by a number alone.
LENGTHS = ("norm", "distance")
_LENGTHS = functions.calls(LENGTHS)
_QUOTIENTS = re.compile(r"/(?!\s*[\d.]+(?![\w.]))|\*\*\s*-")

# A velocity, as far as its name tells.
_VELOCITIES = re.compile(r"\bv\b|\.v[xyz]?\b|\brate\b")


def have_angles(model: nouns.Model) -> bool:
    """True if an expression that holonomic rows are made of has `atan2` or `atan`."""
    return _any(ANGLES, _laws(model.holonomic), _shared(model))


def have_switches(model: nouns.Model) -> bool:
    """True if an expression that equations of constraints are made of has `abs`, `sign`, `min` or `max`."""
    return _any(_SWITCHES, _laws(model.holonomic), _laws(model.differential), _shared(model))


def switching_contacts(model: nouns.Model) -> npt.NDArray[np.bool_]:
    """True for inequalities (K,) in whose expressions a function switches, or in what all may be made of."""
    found = [_any(_SWITCHES, [law.equation.text], _shared(model)) for law in model.inequality]
    return np.repeat(np.array(found, dtype=bool), [law.members.count for law in model.inequality])


def have_switching_forces(model: nouns.Model) -> bool:
    """True if a function switches in an expression that forces are made of."""
    energies = [] if model.lagrangian is None else [model.lagrangian.text]
    forces = [expression.text for expression in model.force_expressions()]
    return _any(_SWITCHES, forces, energies, _shared(model))


def switching_forces(model: nouns.Model) -> tuple[str, ...]:
    """The names of the forces with a function that switches, of all of them where what they share has one."""
    texts = {force.members.base: [each.text for each in _expressions(force)] for force in model.forces}
    shared = _any(_SWITCHES, _shared(model))
    return tuple(name for name, found in texts.items() if shared or _any(_SWITCHES, found))


def may_jump(model: nouns.Model) -> bool:
    """True if a potential, the Lagrangian or a position of a dependent particle has a function that may jump."""
    energies = [force.expression.text for force in model.forces if isinstance(force, nouns.Potential)]
    energies += [] if model.lagrangian is None else [model.lagrangian.text]
    energies += _shared(model)
    return _any(_JUMPS, energies) or (_any(_LENGTHS, energies) and _any(_QUOTIENTS, energies))


def only_forces_may_jump(model: nouns.Model) -> bool:
    """True if a force has a function that may jump, and no equation of a constraint has."""

    def may_jump(own: Iterable[str]) -> bool:
        found = [*own, *_shared(model)]
        return _any(_JUMPS, found) or (_any(_LENGTHS, found) and _any(_QUOTIENTS, found))

    forces = (expression.text for expression in model.force_expressions())
    return may_jump(forces) and not may_jump([*_laws(model.holonomic), *_laws(model.differential)])


def velocity_switches(model: nouns.Model) -> tuple[nouns.Force, ...]:
    """The forces in which something may jump with a velocity."""

    def may_jump(force: nouns.ParticleForce | nouns.GeneralizedForce) -> bool:
        found = [expression.text for expression in _expressions(force)] + shared
        return _any(_VELOCITIES, found) and (_any(_JUMPS, found) or _any(_QUOTIENTS, found))

    shared = _shared(model)
    return tuple(f for f in model.forces if not isinstance(f, nouns.Potential) and may_jump(f))


def _expressions(force: nouns.Force) -> tuple[nouns.Expression, ...]:
    if isinstance(force, nouns.Potential):
        return (force.expression,)
    return tuple(force.force.parts) if isinstance(force, nouns.ParticleForce) else (force.force,)


def texts(model: nouns.Model) -> Iterator[str]:
    """The texts that rows, forces and positions of dependent particles are made of."""
    yield from _laws(model.laws)
    yield from (expression.text for expression in model.force_expressions())
    if model.lagrangian is not None:
        yield model.lagrangian.text
    yield from _shared(model)


def _laws(laws: Iterable[nouns.Law]) -> list[str]:
    return [law.equation.text for law in laws]


def _shared(model: nouns.Model) -> list[str]:
    """The texts of what may stand in any expression."""
    found = [definition.expression.text for definition in model.definitions]
    return found + [part.text for p in model.particles if p.is_dependent for part in p.position.parts]


def _any(words: re.Pattern[str], *texts: Iterable[str]) -> bool:
    return any(words.search(text) for some in texts for text in some)
