"""The functions that a model names: what none of them can bring about is not looked for, nor loaded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from lagcli.expression import functions
from lagcli.model import model as nouns

# Words, as `tree.words` has them.
Words = frozenset[str]


ANGLES = functions.calls(lambda row: row.period > 0)
_SWITCHES = functions.calls(lambda row: row.is_piecewise)
# A power whose exponent is not whole may be a root, and so a modulus.
_JUMPS = functions.calls(lambda row: row.may_jump) | {"**"}
# A length jumps like a modulus where it is divided by, or divides, what changes its sign: not by a number alone.
_LENGTHS = frozenset(("norm(", "distance("))
# What else an expression may hold is smooth wherever it has a value, whole powers too.
NOT_SMOOTH = functions.calls(lambda row: row.may_be_steep) | _LENGTHS | {"**"}
# A velocity, as far as its name tells.
_VELOCITIES = frozenset(("v", ".v", ".vx", ".vy", ".vz", "rate("))


def have_angles(model: nouns.Model) -> bool:
    """True if an expression that holonomic rows are made of has `atan2` or `atan`."""
    return bool(_words(_laws(model.holonomic), _shared(model)) & ANGLES)


def have_switches(model: nouns.Model) -> bool:
    """True if an expression that equations of constraints are made of has `abs`, `sign`, `min` or `max`."""
    return bool(_words(_laws(model.holonomic), _laws(model.differential), _shared(model)) & _SWITCHES)


def switching_contacts(model: nouns.Model) -> npt.NDArray[np.bool_]:
    """True for inequalities (K,) in whose expressions a function switches, or in what all may be made of."""
    shared = _words(_shared(model)) if model.inequality else Words()
    found = [bool((law.equation.words | shared) & _SWITCHES) for law in model.inequality]
    return np.repeat(np.array(found, dtype=bool), [law.members.count for law in model.inequality])


def have_switching_forces(model: nouns.Model) -> bool:
    """True if a function switches in an expression that forces are made of."""
    return bool(_words(model.force_expressions(), _lagrangian(model), _shared(model)) & _SWITCHES)


def switching_forces(model: nouns.Model) -> tuple[str, ...]:
    """The names of the forces with a function that switches, of all of them where what they share has one."""
    shared = _words(_shared(model))
    return tuple(
        force.members.base
        for force in model.forces
        if (_words(nouns.expressions_of(force)) | shared) & _SWITCHES
    )


def may_jump(model: nouns.Model) -> bool:
    """True if a potential, the Lagrangian or a position of a dependent particle has a function that may jump."""
    potentials = (force.expression for force in model.forces if isinstance(force, nouns.Potential))
    return _may_jump(_words(potentials, _lagrangian(model), _shared(model)))


def only_forces_may_jump(model: nouns.Model) -> bool:
    """True if a force has a function that may jump, and no equation of a constraint has."""
    if not _may_jump(_words(model.force_expressions(), _shared(model))):
        return False
    return not _may_jump(_words(_laws(model.holonomic), _laws(model.differential), _shared(model)))


def velocity_switches(model: nouns.Model) -> tuple[nouns.Force, ...]:
    """The forces in which something may jump with a velocity."""
    shared = _words(_shared(model)) if model.forces else Words()
    found = []
    for force in model.forces:
        words = _words(nouns.expressions_of(force)) | shared
        if not isinstance(force, nouns.Potential) and words & _VELOCITIES and words & (_JUMPS | {"/"}):
            found.append(force)
    return tuple(found)


def expressions(model: nouns.Model) -> Iterator[nouns.Expression]:
    """The expressions that rows, forces and positions of dependent particles are made of."""
    yield from _laws(model.laws)
    yield from model.force_expressions()
    yield from _lagrangian(model)
    yield from _shared(model)


def _may_jump(words: Words) -> bool:
    return bool(words & _JUMPS) or ("/" in words and bool(words & _LENGTHS))


def _laws(laws: Iterable[nouns.Law]) -> Iterator[nouns.Expression]:
    return (law.equation for law in laws)


def _lagrangian(model: nouns.Model) -> Iterable[nouns.Expression]:
    return () if model.lagrangian is None else (model.lagrangian,)


def _shared(model: nouns.Model) -> Iterator[nouns.Expression]:
    """The expressions of what may stand in any other."""
    yield from (definition.expression for definition in model.definitions)
    yield from (part for p in model.particles if p.is_dependent for part in p.position.parts)


def _words(*groups: Iterable[nouns.Expression]) -> Words:
    return Words().union(*(expression.words for group in groups for expression in group))
