"""The options of each command, and what is refused about them before any work: options that exclude each other, files
that are missing, of a wrong format, or not to be written.

`require` of the options raises `exits.UsageError`, and `exits.WriteError` for a folder that is missing or closed.
"""

from __future__ import annotations

import dataclasses
import errno
import os
import pathlib
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import TypedDict

from lagcli.cli import exits, file_conflicts, model_reading
from lagcli.model import settings
from lagcli.output import atomic_file, endings

DERIVE_FORMATS = ("text", "latex", "markdown", "html", "json")


class RepeatedRuns(TypedDict):
    """The settings of the runs of `compare` and `limit`, None where the file's stays."""

    duration: float | None
    output_step: float | None
    samples: int | None
    rtol: float | None
    atol: float | None
    max_step: float | None
    assemble: bool | None


def require_models(paths: list[str]) -> None:
    """One MODEL that does not exist is told before the others are worked on. Raises `exits.UsageError`."""
    for path in paths:
        if path != "-" and not os.path.exists(path):
            raise model_reading.missing(path)
    if paths.count("-") > 1:
        raise exits.UsageError("standard input can be read once only")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CheckOptions:
    """Options of `check`; `witness`: the row whose loop is asked for, `plot`: the file of its figure."""

    strict: bool
    assemble: bool
    limit: float
    witness: str | None
    plot: str | None
    as_json: bool
    quiet: bool
    verbose: bool

    def require(self, models: list[str]) -> None:
        """Refuse what cannot be done for these MODELs."""
        require_models(models)
        if self.witness is None:
            if self.plot is not None:
                raise exits.UsageError("--plot draws the loop of --witness NAME; give that too")
            return
        if len(models) > 1:
            raise exits.UsageError("--witness takes one MODEL")
        require_outputs(models[0], None, self.plot, as_json=False)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SimulateOptions:
    """Options of `simulate` besides the settings of the run."""

    output: str | None = None
    plot: str | None = None
    stats: str | None = None
    columns: str | None = None
    as_json: bool = False
    quiet: bool = False
    verbose: bool = False
    checkpoint: str | None = None
    resume: str | None = None
    limit: float = settings.LIMIT
    digits: bool = False
    events: str | None = None
    event_rows: bool = False

    @property
    def to_stdout(self) -> bool:
        """True if the table goes to standard output."""
        return self.output == "-" or (self.output is None and self.plot is None)

    @property
    def file(self) -> str | None:
        """The file of the table, if it goes to one."""
        return None if self.output == "-" else self.output

    @property
    def events_file(self) -> str | None:
        """The file of the incidents, if they go to one."""
        return None if self.events == "-" else self.events

    @property
    def is_stdout_taken(self) -> bool:
        """True if a table goes to standard output."""
        return self.to_stdout or self.events == "-"

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        if self.events == "-" and self.to_stdout:
            raise exits.UsageError(
                "--events -: the rows go to standard output; give -o FILE, or a file for the events"
            )
        if self.digits and self.resume is not None:
            from lagcli.simulation.global_error import error_estimate

            raise exits.UsageError(f"--digits with --resume: {error_estimate.NOT_RESUMED}")
        require_ending(self.file, endings.TABLES)
        require_ending(self.events_file, endings.TABLES)
        require_ending(self.plot, endings.FIGURES)
        for option, name, instead in (
            ("--stats", self.stats, "; --json prints the account"),
            ("--checkpoint", self.checkpoint, ""),
            ("--resume", self.resume, ""),
        ):
            if name == "-":
                raise exits.UsageError(f"{option}: a file name is needed{instead}")
        require_writable(file_conflicts.model(model), self._files(), frozenset(("--checkpoint", "--resume")))

    def _files(self) -> Iterator[file_conflicts.File]:
        """All files of the options, those that belong to others after them."""
        for option, name in (
            ("--output", self.file),
            ("--events", self.events_file),
            ("--plot", self.plot),
            ("--stats", self.stats),
            ("--checkpoint", self.checkpoint),
            ("--resume", self.resume),
        ):
            if name is not None:
                yield file_conflicts.File(option, name, is_written=option != "--resume")
        for option, name in (("--output", self.file), ("--events", self.events_file)):
            if name is None or not atomic_file.is_replaced(pathlib.Path(name)):
                continue
            # The tables of other commands are read: only here are rows kept.
            from lagcli.output.tables import row_file

            table = pathlib.Path(os.path.realpath(name))
            derived = [atomic_file.partial_of(table)]
            derived += [row_file.path_of(table)] if self.checkpoint is not None else []
            for path in derived:
                yield file_conflicts.File(option, os.fspath(path), is_written=True, is_derived=True)


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
        require_models(list(self.files))
        require_ending(self.output, endings.FIGURES)
        if self.output is None and not self.show and not sys.stdout.isatty():
            raise exits.UsageError("nothing to draw on: give -o FILE.png (svg, pdf), or --show for text")
        if self.events is not None:
            require_ending(self.events, endings.TABLES)
            if not os.path.exists(self.events):
                raise exits.UsageError(f"--events: there is no file {self.events}")
        given = {**self.run, "from": self.begin, "set": self.changes or None}
        options = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
        if not self.models and options:
            raise exits.UsageError(
                f"{options[0]} is for a MODEL that is simulated, and there are tables alone"
            )
        if self.output is not None:
            read = [file for name in self.files for file in file_conflicts.model(name)]
            read += [file_conflicts.File("--events", self.events)] if self.events is not None else []
            require_writable(read, [file_conflicts.File("--output", self.output, is_written=True)])


def is_table(name: str) -> bool:
    """True for the name of a table, by its ending."""
    return pathlib.PurePath(name).suffix.lower().removeprefix(".") in endings.TABLES


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PrinciplesOptions:
    """Options of `compare --vakonomic`: initial multipliers as they were given, and files for table and figure."""

    vakonomic: bool = False
    mu: tuple[str, ...] = ()
    output: str | None = None
    plot: str | None = None

    def require(self, models: list[str], as_json: bool) -> None:
        """Refuse what cannot be done for these MODELs."""
        if not self.vakonomic:
            for option, given in (("--mu", self.mu), ("--output", self.output), ("--plot", self.plot)):
                if given:
                    raise exits.UsageError(f"{option} is of the vakonomic motion; give --vakonomic too")
            return
        if len(models) > 1:
            raise exits.UsageError("--vakonomic compares the two principles of one MODEL")
        require_outputs(models[0], self.output, self.plot, as_json)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CompareOptions:
    """Options of `compare` besides the settings of the runs."""

    columns: str | None
    tolerance: float | None
    as_json: bool
    quiet: bool
    principles: PrinciplesOptions = PrinciplesOptions()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ModesOptions:
    """Options of `modes` besides its settings; `animate`: the file of a page."""

    plot: str | None
    animate: str | None
    as_json: bool
    quiet: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done for this MODEL."""
        require_models([model])
        require_ending(self.animate, ("html",))
        require_ending(self.plot, endings.FIGURES)
        named = (("--plot", self.plot), ("--animate", self.animate))
        files = [
            file_conflicts.File(option, name, is_written=True) for option, name in named if name is not None
        ]
        if files:
            require_writable(file_conflicts.model(model), files)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LimitOptions:
    """Options of `limit` besides the settings of the runs."""

    constraint: str
    stiffness: str | None
    unprestressed: bool
    ramp: float | None
    output: str | None
    plot: str | None
    as_json: bool
    quiet: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        require_outputs(model, self.output, self.plot, self.as_json)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class AuditOptions:
    """Options of `audit` besides the settings of the run; `has_rows`: --duration or --samples is given."""

    table: str | None
    events: str | None
    plot: str | None
    digits: bool
    as_json: bool
    quiet: bool
    verbose: bool
    has_rows: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        require_ending(self.plot, endings.FIGURES)
        require_ending(self.table, endings.TABLES)
        if self.table is not None and not os.path.exists(self.table):
            raise exits.UsageError(f"--run: there is no file {self.table}")
        require_ending(self.events, endings.TABLES)
        if self.events is not None and self.table is None:
            raise exits.UsageError("--events: the incidents are of the table of --run, which is missing")
        if self.events is not None and not os.path.exists(self.events):
            raise exits.UsageError(f"--events: there is no file {self.events}")
        if self.plot is not None:
            given = (("--run", self.table), ("--events", self.events))
            read = [file_conflicts.File(option, file) for option, file in given if file is not None]
            figure = file_conflicts.File("--plot", self.plot, is_written=True)
            require_writable(file_conflicts.model(model), [*read, figure])
        if self.table is not None and self.has_rows:
            raise exits.UsageError(
                "--run: the table has its own rows; --duration and --samples are of a new run"
            )


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PointOptions:
    """Options of `stationary` and `equilibrium`."""

    output: str | None
    starts: int
    seed: int
    limit: float
    as_json: bool
    quiet: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        require_outputs(model, self.output, None, self.as_json)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SweepFiles:
    """Options of `sweep` besides its points: files, and who computes."""

    output: str | None
    tables: str | None
    shard: str | None
    scheduler: str | None
    jobs: int
    resume: bool
    as_json: bool
    quiet: bool

    @property
    def target(self) -> str | None:
        """The file or, with a stroke at its end, the folder of a dataset; None for standard output."""
        return None if self.output in (None, "-") else self.output

    @property
    def is_dataset(self) -> bool:
        """True if the rows are one part of a folder."""
        name = self.target or ""
        return name.endswith(("/", os.sep)) or os.path.isdir(name)

    def path(self, number: int, count: int) -> pathlib.Path:
        """The file of this shard."""
        assert self.target is not None
        if self.is_dataset:
            return pathlib.Path(self.target) / f"part-{number:05d}-of-{count:05d}.parquet"
        return pathlib.Path(self.target)

    def rows_so_far(self, path: pathlib.Path) -> pathlib.Path:
        """The name that the rows of an interrupted sweep get, before `.partial`. In a folder it begins with a dot: what
        reads a dataset passes over such files, and over no others."""
        return path.with_name(f".{path.name}") if self.is_dataset else path

    def require(self, model: str, points: str | None) -> None:
        """Refuse what cannot be done for this MODEL and these points."""
        if model == points == "-":
            raise exits.UsageError("standard input can be read once only: MODEL and --points are both -")
        if self.scheduler is not None and self.jobs != 1:
            raise exits.UsageError("--jobs and --scheduler both say who computes; give one of them")
        if self.target is None:
            if self.resume:
                raise exits.UsageError(
                    "--resume goes on in the file of the sweep before: give it with -o FILE"
                )
            if self.as_json:
                raise exits.UsageError("--json has standard output: give a file for the rows with -o FILE")
        elif not self.is_dataset:
            require_outputs(model, self.output, None, self.as_json)
            if points not in (None, "-"):
                given = file_conflicts.File("--points", str(points))
                require_writable([given], [file_conflicts.File("--output", self.target, is_written=True)])

    def require_merge(self, paths: Iterable[str]) -> None:
        """Refuse what cannot be done with the tables of these shards."""
        if self.target is None and self.as_json:
            raise exits.UsageError("--json has standard output: give a file for the rows with -o FILE")
        if self.target is None:
            return
        if self.is_dataset:
            raise exits.UsageError(
                f"--merge: {self.target} is a folder; the parts of a dataset need no merging"
            )
        require_ending(self.target, endings.TABLES)
        read = [file_conflicts.File("--merge", path) for path in paths]
        require_writable(read, [file_conflicts.File("--output", self.target, is_written=True)])


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DeriveOptions:
    """Options of `derive`; `form`: one of `DERIVE_FORMATS`, `fragment`: its equations alone, `values`: names of
    parameters to put in as numbers."""

    form: str
    fragment: bool
    solve: bool
    everything: bool
    values: str
    limit: float

    def require(self) -> None:
        """Refuse a format there is not, and a fragment of one that has none."""
        if self.form not in DERIVE_FORMATS:
            raise exits.UsageError(f"--format {self.form}: the formats are {', '.join(DERIVE_FORMATS)}")
        if self.fragment and self.form != "latex":
            raise exits.UsageError("--fragment is of --format latex; the other formats are pages")


def require_ending(name: str | None, known: tuple[str, ...]) -> None:
    """Refuse a file whose name ends in none of the known formats."""
    if name is None:
        return
    try:
        endings.of(pathlib.Path(name), known)
    except endings.UnknownFormat as error:
        raise exits.UsageError(str(error)) from None


def require_outputs(model: str, output: str | None, plot: str | None, as_json: bool) -> None:
    """Refuse a table, `-` for standard output, and a figure that cannot be written beside this MODEL."""
    if as_json and output == "-":
        raise exits.UsageError("--output -: --json has standard output; give a file")
    table = None if output == "-" else output
    require_ending(table, endings.TABLES)
    require_ending(plot, endings.FIGURES)
    named = (("--output", table), ("--plot", plot))
    files = [file_conflicts.File(option, name, is_written=True) for option, name in named if name is not None]
    if files:
        require_writable(file_conflicts.model(model), files)


def require_writable(
    model: Iterable[file_conflicts.File],
    files: Iterable[file_conflicts.File],
    together: frozenset[str] = frozenset(),
) -> None:
    """Refuse files that are one, and those that cannot be made or replaced, before a long run and not after it.

    together: two options that may name one file.
    """
    everything = (*model, *files, *file_conflicts.stdout())
    file_conflicts.require_separate(everything, together)
    for file in everything:
        if file.is_written and file.number is None:
            _require_place(file.name)


def _require_place(name: str) -> None:
    with exits.writing(name):
        target = atomic_file.destination(pathlib.Path(name))
        # Files are written aside and moved, so that the folder counts; a pipe or a device is written in place.
        is_replaced = atomic_file.is_replaced(target)
        place, rights = (target.parent, os.W_OK | os.X_OK) if is_replaced else (target, os.W_OK)
        os.stat(place)
        if not os.access(place, rights):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
