"""The settings of a run and their bounds, the same for the file, the command line and Python."""

from __future__ import annotations

import functools
import math
import typing
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Annotated, TypedDict

from lagcli import progress
from lagcli.errors import diagnostics, requirements
from lagcli.frozen import frozen_value

# Of the schemes there are, each a file of `simulation` with a line in `method.METHODS`; `auto` is the first.
METHOD_NAMES = ("dop853",)
METHODS = ("auto", *METHOD_NAMES)
# Native code where it pays, from the first step on, or not at all.
COMPILE = ("auto", "always", "never")
_EXPRESSION = "expression of parameters"
MAX_ROWS = 10**9  # a billion rows of ten columns are 80 GB
MOST_STEPS = 1e10  # of a run; they would take days
LIMIT = progress.Counted(20.0)  # seconds for the proofs of a model
_OUTPUT_STEP = (
    "the output step must be positive",
    f"that makes more than {MAX_ROWS} rows",
    "the output step is below the rounding of the time",
)
_MAX_STEP = (
    "the largest step must be positive and finite",
    f"that makes more than {MOST_STEPS:.0e} steps",
    "the largest step is below the rounding of the start",
)


@frozen_value
class RunSetting:
    """A setting, with all that files and commands need of it. meaning: one line, of the help too; holds: what stands
    under its key in a file; default: as the manual writes it; example: a value as it is written in a file; is_option:
    the command line has it; instead_of: settings beside which it may not stand."""

    meaning: str
    holds: str = _EXPRESSION
    default: str = ""
    example: str = ""
    is_option: bool = True
    instead_of: tuple[str, ...] = ()


@frozen_value
class Simulation:
    """The settings of a run: times in the model's unit, `keep` in names of coordinates (`theta`, `a`, `a.x`). A setting
    is a field here, with what it is, and one of `RunSettings`: the model file and its schema, the options of all
    commands that make runs, their help, and the keywords in Python have it from here."""

    start: Annotated[
        float, RunSetting("time of the initial values", default="0", example="1", is_option=False)
    ] = 0.0
    duration: Annotated[float, RunSetting("length of the run", default="10", example="2*pi*sqrt(L/g)")] = 10.0
    samples: Annotated[
        int, RunSetting("number of rows, both ends counted", "whole number", "1001", "201")
    ] = 1001
    output_step: Annotated[
        float | None,
        RunSetting("time between rows, instead of `samples`", example="0.01", instead_of=("samples",)),
    ] = None
    method: Annotated[
        str,
        RunSetting("the integration scheme", " or ".join(f"`{name}`" for name in METHODS), "auto", "auto"),
    ] = "auto"
    compile: Annotated[
        str,
        RunSetting(
            "native code for the steps, with the same numbers",
            " or ".join(f"`{mode}`" for mode in COMPILE),
            "auto",
            "never",
        ),
    ] = "auto"
    rtol: Annotated[float, RunSetting("relative tolerance of a step", default="1e-11", example="1e-9")] = (
        1e-11
    )
    atol: Annotated[
        float | None,
        RunSetting(
            "absolute tolerance of a step", default="1e-13 of the sizes of the motion", example="1e-12"
        ),
    ] = None
    max_step: Annotated[
        float | None, RunSetting("what no step is longer than, for forces that steps may miss", example="0.1")
    ] = None
    assemble: Annotated[
        bool,
        RunSetting("move the start to the nearest consistent state", "`true` or `false`", "false", "true"),
    ] = False
    keep: Annotated[
        tuple[str, ...],
        RunSetting(
            "coordinates that assembly must not move",
            "list of coordinates",
            example="[theta, a.x]",
            is_option=False,
        ),
    ] = ()


class RunSettings(TypedDict, total=False):
    """The settings of a run as keywords; what is None is as the model says."""

    start: float | None
    duration: float | None
    samples: int | None
    output_step: float | None
    method: str | None
    compile: str | None
    rtol: float | None
    atol: float | None
    max_step: float | None
    assemble: bool | None
    keep: tuple[str, ...] | None


@functools.cache
def keyword_types() -> Mapping[str, object]:
    """The type of each setting as a keyword."""
    return typing.get_type_hints(RunSettings)


@functools.cache
def table() -> Mapping[str, tuple[object, RunSetting]]:
    """The type of each setting, None left out, and what it is."""
    rows = {}
    for name, hint in typing.get_type_hints(Simulation, include_extras=True).items():
        kind, row = typing.get_args(hint)
        options = [each for each in typing.get_args(kind) if each is not type(None)]
        rows[name] = (options[0] if type(None) in typing.get_args(kind) else kind, row)
    return rows


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
    if settings.output_step is not None and (
        fault := _step_fault(settings, settings.output_step, MAX_ROWS, _OUTPUT_STEP)
    ):
        yield "output_step", fault
    if (name := settings.method) not in METHODS:
        word = name.casefold().replace("-", "_").replace("stoermer", "stormer")
        more = diagnostics.meant("methods").get(word) or diagnostics.nearest(name, METHODS)
        sentence = f"there is no method `{name}`" if name else "the method has no name"
        hint = f": {more}" if name and more else ""
        yield "method", f"{sentence}; there are {', '.join(METHODS)}{hint}"
    if settings.compile not in COMPILE:
        yield "compile", f"must be {', '.join(COMPILE[:-1])} or {COMPILE[-1]}, and not `{settings.compile}`"
    elif settings.compile == "always":
        if find_spec("llvmlite") is None:
            yield "compile", 'native code needs llvmlite, which is not installed: pip install "lagcli[fast]"'
        elif refusal := requirements.too_old(["llvmlite"]):
            yield "compile", refusal
    if not 1e-15 <= settings.rtol <= 0.1:
        yield "rtol", "rtol must be between 1e-15 and 0.1"
    if settings.atol is not None and not (math.isfinite(settings.atol) and settings.atol > 0):
        yield "atol", "atol must be positive"
    if settings.max_step is not None and (
        fault := _step_fault(settings, settings.max_step, MOST_STEPS, _MAX_STEP)
    ):
        yield "max_step", fault


def _step_fault(settings: Simulation, step: float, most: float, sentences: tuple[str, str, str]) -> str:
    """The sentence for a step that is not positive and finite, makes too many, or is lost in the time; else empty."""
    if not (math.isfinite(step) and step > 0):
        return sentences[0]
    if settings.duration / step > most:
        return sentences[1]
    return sentences[2] if settings.start + step == settings.start else ""
