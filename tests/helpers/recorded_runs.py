"""A run of lagcli with its incidents, in the arrays that the judges of one-sided motions read."""

from __future__ import annotations

import itertools

import numpy as np

import lagcli
from lagcli.api.runs import prepare_run, run_settings
from lagcli.simulation.run_state.incident import Incident
from tests.helpers.motion_legs import Instant, Recorded
from tests.helpers.one_sided_models import Floats, Scene


def run(text: str, **options: object) -> tuple[tuple[str, ...], Floats, list[Incident], tuple[str, ...]]:
    """Columns and rows of a run, its incidents, and the names of the rows of their impulses."""
    model = lagcli.loads(text)
    running = prepare_run.start(model, run_settings.chosen(model, options))
    incidents: dict[int, Incident] = {}
    blocks = []
    for block in running.blocks():
        blocks.append(block.copy())
        incidents |= {id(each): each for each in running.incidents}
    columns = tuple(running.columns)
    rows = tuple(c.removeprefix("lambda.") for c in columns if c.startswith("lambda."))
    return columns, np.concatenate(blocks), list(incidents.values()), rows


def recorded(scene: Scene, **options: object) -> Recorded:
    """The run of a scene. Raises what the run raises."""
    columns, table, incidents, rows = run(scene.text(), **options)
    at = {name: k for k, name in enumerate(columns)}
    count = range(len(scene.m))
    places = [[at[f"p{i}.{axis}"] for axis in "xyz"] for i in count]
    speeds = [[at[f"p{i}.v{axis}"] for axis in "xyz"] for i in count]
    instants = []
    for t, group in itertools.groupby(incidents, key=lambda each: each.t):
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
