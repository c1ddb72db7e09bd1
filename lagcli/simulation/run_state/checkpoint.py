"""A run between two steps as a file of JSON, and for which model and settings it is.

Doubles are written so that they read back to the same double. What is read is checked to the last number, and
all numbers together by a sum: a checkpoint is a file like any other, and may be torn, damaged or of another make.
"""

from __future__ import annotations

import hashlib
import json
import os

from lagcli import __version__
from lagcli.equations import system
from lagcli.errors.diagnostics import printable
from lagcli.frozen import frozen, frozen_value
from lagcli.model import settings
from lagcli.model.invariant import FirstIntegral
from lagcli.model.model import Model, Vector3
from lagcli.simulation.run_state.between_steps import RunState

FORMAT = 10  # of a checkpoint: goes up where another version could not read it
MOST_BYTES = 2**28  # of a file that is read: states of ten thousand particles are some megabytes
# What stands beside the parts of a checkpoint.
AROUND = ("lagcli-checkpoint", "version", "sum")
MOST_VERSION = 40  # letters of a version that are shown


class CheckpointError(ValueError):
    """A file that is no checkpoint, or one that this run cannot go on from."""


@frozen_value
class Identity:
    """The data that must agree for a run to go on: the text of the model, its settings, and what `--set` may change, as
    the declared start q, v (n,)."""

    fingerprint: str
    parameters: dict[str, float | Vector3]
    q: tuple[float, ...]
    v: tuple[float, ...]
    start: float
    rtol: float
    atol: float | None
    method: str
    max_step: float | None = None


@frozen_value
class CheckpointTable:
    """The table a run was writing: its file, seen from the folder of the checkpoint; step: between its rows; count,
    checksum: of those that were written; has_event_rows: with rows of the instants of incidents."""

    file: str
    step: float
    count: int
    checksum: int
    has_event_rows: bool = False


@frozen
class Checkpoint:
    """A run, and whose; integrals: those found of its differential rows; table, events: where its rows and its
    incidents went, where that are files."""

    identity: Identity
    run_state: RunState
    integrals: tuple[FirstIntegral, ...]
    table: CheckpointTable | None = None
    events: CheckpointTable | None = None

    @property
    def t_end(self) -> float:
        """The time of the last row before it."""
        return self.run_state.origin + self.run_state.row


def identity(model: Model) -> Identity:
    """The identity of a run of a model with its settings."""
    q, v = system.start(model)
    chosen = model.simulation
    return Identity(
        model.fingerprint,
        {parameter.name: parameter.value for parameter in model.parameters},
        tuple(q.tolist()),
        tuple(v.tolist()),
        chosen.start,
        chosen.rtol,
        chosen.atol,
        settings.method_name(chosen),
        chosen.max_step,
    )


def require_same(found: Identity, model: Model) -> None:
    """Raise `CheckpointError` with what differs between a checkpoint and the model it shall go on with."""
    there, here, names = found, identity(model), model.coordinate_names
    sentence = ""
    if there.fingerprint != here.fingerprint:
        sentence = "the text of the model, or of the position of a dependent particle, is different"
    elif there.parameters.keys() != here.parameters.keys():
        sentence = "its parameters are others"
    elif len(there.q) != len(here.q) or len(there.v) != len(here.v):
        sentence = f"it has {len(there.q)} coordinates, the model {len(here.q)}"
    else:
        pairs: list[tuple[str, object, object]] = [
            (f"the parameter `{name}`", there.parameters[name], here.parameters[name])
            for name in here.parameters
        ]
        pairs += [(f"the start of `{n}`", a, b) for n, a, b in zip(names, there.q, here.q, strict=True)]
        pairs += [
            (f"the initial rate of `{n}`", a, b) for n, a, b in zip(names, there.v, here.v, strict=True)
        ]
        for name in ("start", "rtol", "atol", "method", "max_step"):
            pairs.append((f"`{name}`", getattr(there, name), getattr(here, name)))
        for what, *values in pairs:
            if values[0] != values[1]:
                plain = [list(each) if isinstance(each, tuple) else each for each in values]
                a, b = ("not given" if each is None else str(each) for each in plain)
                sentence = f"{what} is {a} in it and {b} here"
                break
    if sentence:
        raise CheckpointError(f"it belongs to a different run: {sentence}")


def encoded(point: Checkpoint) -> bytes:
    """The checkpoint as JSON."""
    from lagcli.simulation.run_state import saved_form

    parts = saved_form.saved(point)
    assert isinstance(parts, dict)
    whole = {"lagcli-checkpoint": FORMAT, "version": __version__, **parts, "sum": control_sum(parts)}
    return json.dumps(whole, allow_nan=False).encode() + b"\n"


def control_sum(parts: object) -> str:
    """Tells whether any number or text has changed; how a file is laid out plays no part in it."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read(path: str | os.PathLike[str]) -> Checkpoint:
    """The checkpoint in a file. Raises `CheckpointError`, `OSError`."""
    with open(path, "rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise CheckpointError("it is too large for a checkpoint")
    return decoded(data)


def decoded(data: bytes) -> Checkpoint:
    """The checkpoint in JSON. Raises `CheckpointError`."""
    from lagcli.simulation.run_state import saved_form

    try:
        whole = json.loads(data)
    except (ValueError, RecursionError):
        raise CheckpointError("it is no checkpoint, or torn") from None
    if not isinstance(whole, dict) or "lagcli-checkpoint" not in whole:
        raise CheckpointError("it is no checkpoint")
    # Another version may compute other last digits, so that the rows would not be those of one run.
    form, version, ours = whole["lagcli-checkpoint"], whole.get("version"), f"this is lagcli {__version__}"
    if version is not None and version != __version__:
        theirs = printable(str(version))[:MOST_VERSION]
        raise CheckpointError(
            f"it was written by lagcli {theirs}, and {ours}, a different version, whose last digits may differ: go on"
            f' with `pip install "lagcli=={theirs}"`, or begin the run again'
        )
    if form != FORMAT:
        raise CheckpointError(
            f"it is a checkpoint of a different version, of format {printable(str(form))[:MOST_VERSION]}, and {ours},"
            f" which reads format {FORMAT}: go on with the version that wrote it, or begin the run again"
        )
    try:
        point = saved_form.read(Checkpoint, {key: part for key, part in whole.items() if key not in AROUND})
        _require_valid(point)
    except ValueError:
        raise CheckpointError(
            "it is a damaged checkpoint: something is missing or no finite number"
        ) from None
    if (
        not len(point.run_state.y)
        == len(point.run_state.k)
        == 2 * len(point.identity.q) + 1
        == 2 * len(point.identity.v) + 1
    ):
        raise CheckpointError("it is a damaged checkpoint: its parts are not of one length")
    if point.run_state.origin + min(point.run_state.t, point.run_state.row) < point.identity.start:
        raise CheckpointError("it is a damaged checkpoint: it is from before the start of its run")
    if control_sum(saved_form.saved(point)) != whole.get("sum"):
        raise CheckpointError("it is a damaged checkpoint: its numbers are not those that were written")
    return point


def _require_valid(point: Checkpoint) -> None:
    """Raise `ValueError` for numbers that no run has."""
    run_state, selection = point.run_state, point.run_state.selection
    if run_state.step <= 0:
        raise ValueError("a step that does not advance")
    if len(run_state.invariant_values) != len(point.integrals):
        raise ValueError("levels of other integrals")
    if run_state.reported.incidents < run_state.tally.incidents:
        raise ValueError("incidents that were not reported")
    for integral, level in zip(point.integrals, run_state.invariant_values, strict=True):
        if level is not None and level.chart >= len(integral.charts):
            raise ValueError("a chart that there is not")
    if not all(selection.dependencies):
        raise ValueError("a circuit without rows")
    if sorted([*selection.present, *selection.inactive]) != list(range(selection.count)):
        raise ValueError("rows that are not all there")
    supports = {row for dependency in (*selection.dependencies, *selection.idle) for row in dependency[1:]}
    if not (all(selection.idle) and supports <= set(selection.independent)):
        raise ValueError("a row that depends on rows left out")
    if not {dependency[0] for dependency in selection.idle} <= set(selection.inactive):
        raise ValueError("a row that acts and carries nothing")
