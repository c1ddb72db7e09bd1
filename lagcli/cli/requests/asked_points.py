"""The options of `sweep` that say which points there are."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import sys
import tempfile

from lagcli.api.sweeps import drawn_points, point_sources, sweep_plan
from lagcli.cli.terminal import exits
from lagcli.model.model import Model
from lagcli.output.files import formats
from lagcli.output.tables import read_table, table_format

UNREADABLE = (formats.UnknownFormat, table_format.MissingExtra, table_format.UnreadableTable)


@dataclasses.dataclass(frozen=True, slots=True)
class AskedPoints:
    """The options that say which points there are."""

    over: tuple[str, ...]
    points: str | None
    uncertain: tuple[str, ...]
    draws: int
    seed: int
    sampling: str
    yes: bool

    def read(self, model: Model) -> list[point_sources.SweepPoints]:
        """The sources of the points. Raises `exits.UsageError`, `ModelError`."""
        if self.over and self.points is not None:
            raise exits.UsageError("--over and --points both say which points there are; give one of them")
        parts: list[point_sources.SweepPoints] = []
        for text in self.over:
            parts.append(point_sources.over(model, text))
            sweep_plan.require_names(model, parts[-1], "--over")
        if self.points is not None:
            parts.append(_table(self.points))
            sweep_plan.require_names(model, parts[-1], f"--points {_shown(self.points)}:")
        if self.uncertain:
            laws = [drawn_points.read(model, text) for text in self.uncertain]
            parts.append(drawn_points.draw(laws, self.draws, self.seed, self.sampling))
            sweep_plan.require_names(model, parts[-1], drawn_points.LABEL)
        if not parts:
            raise exits.UsageError("no points: give --over NAME=LOW:HIGH:COUNT, --points FILE or --uncertain")
        return parts


def _shown(points: str) -> str:
    return "<stdin>" if points == "-" else points


def _table(points: str) -> point_sources.TableOfPoints:
    """The points of a table. Raises `exits.UsageError`, `BadPoints`."""
    label = f"--points {_shown(points)}"
    with contextlib.ExitStack() as stack:
        path = points
        if os.path.isdir(path):
            raise exits.UsageError(f"--points: {points} is a folder, and a table of points is needed")
        if points == "-":
            # Tables are read twice, first their names: what comes through a pipe is put aside.
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            path = os.path.join(folder, "points.csv")
            pathlib.Path(path).write_bytes(sys.stdin.buffer.read())
        try:
            names, rows = read_table.read(path)
        except FileNotFoundError:
            raise exits.UsageError(f"--points: there is no file {points}") from None
        except OSError as error:
            raise exits.UsageError(f"--points: cannot read {points}: {error.strerror}") from None
        except UNREADABLE as error:
            raise exits.UsageError(f"--points {str(error).replace(path, _shown(points))}") from None
    return point_sources.TableOfPoints(names, rows, label)
