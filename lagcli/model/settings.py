"""The settings of a run and their bounds, the same for the file, the command line and Python."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.errors import diagnostics

if TYPE_CHECKING:  # the command line reads the bounds before it has to load numbers
    from lagcli.model.model import Simulation

# Of the schemes there are, each a file of `simulation` with a line in `method.METHODS`; `auto` is the first.
METHOD_NAMES = ("dop853",)
METHODS = ("auto", *METHOD_NAMES)
# Schemes of other programs, and what there is to say to who looks for one, after the names there are.
_ELSEWHERE = {
    **dict.fromkeys(
        ("rk", "rk4", "rk23", "rk45", "rkf45", "dopri5", "ode45", "tsit5", "heun", "midpoint", "euler"),
        "dop853 is an explicit Runge-Kutta scheme too, of order 8",
    ),
    **dict.fromkeys(
        (
            "radau",
            "bdf",
            "lsoda",
            "cvode",
            "cvodes",
            "ida",
            "idas",
            "ode15s",
            "rosenbrock",
            "implicit",
            "backward_euler",
        ),
        "none of these is implicit, for stiff forces: turn the stiffest springs into constraints, or soften them",
    ),
    **dict.fromkeys(
        ("verlet", "leapfrog", "stormer", "rattle", "shake", "symplectic", "variational", "symplectic_euler"),
        "none of these is symplectic: states satisfy the constraints by projection, and the account states the"
        " energy balance",
    ),
}
MAX_ROWS = 10**9  # a billion rows of ten columns are 80 GB
MOST_STEPS = 1e10  # of a run; they would take days
LIMIT = progress.Counted(20.0)  # seconds for the proofs of a model


def method_name(settings: Simulation) -> str:
    """The name of the scheme a run takes."""
    return METHOD_NAMES[0] if settings.method == "auto" else settings.method


def faults(settings: Simulation) -> Iterator[tuple[str, str]]:
    """Pairs (key, sentence) of everything that is out of bounds."""
    if not math.isfinite(settings.start):
        yield "start", "the start must be a finite time"
    if not (math.isfinite(settings.duration) and settings.duration >= 0):
        yield "duration", "the duration must be finite and not negative"
    elif settings.duration and settings.start + settings.duration == settings.start:
        yield "duration", "the duration is below the rounding of the start"
    if not 2 <= settings.samples <= MAX_ROWS:
        yield "samples", f"samples must be between 2 and {MAX_ROWS}: both ends are counted"
    if settings.output_step is not None:
        yield from _step_faults(settings, settings.output_step)
    if settings.method not in METHODS:
        yield "method", _no_method(settings.method)
    if not 1e-15 <= settings.rtol <= 0.1:
        yield "rtol", "rtol must be between 1e-15 and 0.1"
    if settings.atol is not None and not (math.isfinite(settings.atol) and settings.atol > 0):
        yield "atol", "atol must be positive"
    if settings.max_step is not None:
        yield from _largest_step_faults(settings, settings.max_step)


def _no_method(name: str) -> str:
    """The fault of a method that there is not."""
    if not name:
        return f"the method has no name; there are {', '.join(METHODS)}"
    sentence = f"there is no method `{name}`; there are {', '.join(METHODS)}"
    word = name.casefold().replace("-", "_").replace("stoermer", "stormer")
    more = _ELSEWHERE.get(word) or diagnostics.nearest(name, METHODS)
    return f"{sentence}: {more}" if more else sentence


def _step_faults(settings: Simulation, step: float) -> Iterator[tuple[str, str]]:
    if not (math.isfinite(step) and step > 0):
        yield "output_step", "the output step must be positive"
    elif settings.duration / step > MAX_ROWS:
        yield "output_step", f"that makes more than {MAX_ROWS} rows"
    elif settings.start + step == settings.start:
        yield "output_step", "the output step is below the rounding of the time"


def _largest_step_faults(settings: Simulation, step: float) -> Iterator[tuple[str, str]]:
    if not (math.isfinite(step) and step > 0):
        yield "max_step", "the largest step must be positive and finite"
    elif settings.duration / step > MOST_STEPS:
        yield "max_step", f"that makes more than {MOST_STEPS:.0e} steps"
    elif settings.start + step == settings.start:
        yield "max_step", "the largest step is below the rounding of the start"
