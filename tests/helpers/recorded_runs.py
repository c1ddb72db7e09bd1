"""A run of lagcli with its incidents, in the arrays that the judges of one-sided motions read."""

from __future__ import annotations

import itertools

import numpy as np

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.statistics import Incident
from tests.helpers.motion_legs import Instant, Recorded
from tests.helpers.one_sided_models import Floats, Scene


def run(text: str, **options: object) -> tuple[tuple[str, ...], Floats, list[Incident], tuple[str, ...]]:
    """Columns and rows of a run, its incidents, and the names of the rows of their impulses."""
    columns, table, incidents, stopped = run_to_stop(text, **options)
    if stopped is not None:
        raise stopped
    return columns, table, incidents, tuple(c[7:] for c in columns if c.startswith("lambda."))


def run_to_stop(
    text: str, **options: object
) -> tuple[tuple[str, ...], Floats, list[Incident], run_stop.RunStop | None]:
    """Columns and rows of a run, its incidents, and why it stopped before its end."""
    model = lagcli.loads(text)
    running = prepare_run.start(model, run_settings.chosen(model, options))
    incidents: dict[int, Incident] = {}
    blocks, stopped = [np.zeros((0, len(running.columns)))], None
    try:
        for block in running.blocks():
            blocks.append(block.copy())
            incidents |= {id(each): each for each in running.incidents}
    except run_stop.RunStop as stop:
        stopped = stop
        incidents |= {id(each): each for each in running.incidents}
    return tuple(running.columns), np.concatenate(blocks), list(incidents.values()), stopped


def recorded(scene: Scene, **options: object) -> Recorded:
    """The run of a scene. Raises what the run raises."""
    columns, table, incidents, rows = run(scene.text(), **options)
    at = {name: k for k, name in enumerate(columns)}
    count = range(len(scene.m))
    places = [[at[f"p{i}.{axis}"] for axis in "xyz"] for i in count]
    speeds = [[at[f"p{i}.v{axis}"] for axis in "xyz"] for i in count]
    instants = []
    # Impacts may follow each other at one instant.
    for (t, _), group in itertools.groupby(incidents, key=lambda each: (each.t, each.impulses.tobytes())):
        told = list(group)
        line, after = (np.concatenate([[t], state]) for state in (told[0].before, told[0].after))
        impulses = dict(zip(rows, told[0].impulses.tolist(), strict=True))
        kinds = tuple((each.kind, each.name) for each in told)
        instants.append(Instant(t, kinds, impulses, after[places], line[speeds], after[speeds]))
    return Recorded(
        instants,
        table[:, 0],
        table[:, np.array(places)],
        table[:, np.array(speeds)],
        {name: table[:, at[f"lambda.{name}"]] for name in rows},
        table[:, at["energy"]],
    )
