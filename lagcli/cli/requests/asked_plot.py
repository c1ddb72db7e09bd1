"""The options of `plot`, and what is refused about them."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import sys
from collections.abc import Mapping

from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.output.files import file_requests, formats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PlotOptions:
    """Options of `plot`: what is drawn, and where; of models `changes` (`--set`), `run` (the settings) and `begin`."""

    files: tuple[str, ...]
    y: tuple[str, ...] = ()
    x: str | None = None
    xy: tuple[str, ...] = ()
    events: str | None = None
    log: bool = False
    title: str | None = None
    output: str | None = None
    show: bool = False
    changes: tuple[str, ...] = ()
    run: Mapping[str, float | int | str | bool | None] = dataclasses.field(default_factory=dict)
    begin: str | None = None
    quiet: bool = False

    @property
    def read(self) -> tuple[str, ...]:
        """The files that are read, but that of `--from`, which is where a run begins."""
        return (*self.files, *([self.events] if self.events is not None else []))

    @property
    def models(self) -> tuple[str, ...]:
        """The files that are models, by their endings."""
        return tuple(name for name in self.files if name != "-" and not is_table(name))

    @property
    def is_shown(self) -> bool:
        """True if the terminal is drawn on."""
        return self.show or self.output is None

    def require(self) -> None:
        """Refuse what cannot be done for these files."""
        model_reading.require_models(list(self.files))
        file_requests.require_endings((self.output, formats.FIGURES))
        if self.output is None and not self.show and not sys.stdout.isatty():
            raise exits.UsageError("nothing to draw on: give -o FILE.png (svg, pdf), or --show for text")
        if self.events is not None:
            file_requests.require_endings((self.events, formats.TABLES))
            if not os.path.exists(self.events):
                raise exits.UsageError(f"--events: there is no file {self.events}")
        given = {**self.run, "from": self.begin, "set": self.changes or None}
        options = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
        if not self.models and options:
            raise exits.UsageError(
                f"{options[0]} is for a MODEL that is simulated, and there are tables alone"
            )
        if self.output is not None:
            read = [file for name in self.files for file in file_requests.model_file(name)]
            read += [file_requests.File("--events", self.events)] if self.events is not None else []
            file_requests.require_writable(
                read, [file_requests.File("--output", self.output, is_written=True)]
            )


def is_table(name: str) -> bool:
    """True for the name of a table, by its ending."""
    return pathlib.PurePath(name).suffix.lower().removeprefix(".") in formats.TABLES
