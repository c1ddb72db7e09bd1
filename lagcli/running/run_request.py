"""A request for the files of a run, and what is refused about it."""

from __future__ import annotations

import contextlib
import os
import pathlib

from lagcli.frozen import frozen
from lagcli.model import settings
from lagcli.output.files import atomic_file, formats, write_guard
from lagcli.output.files.write_guard import BadRequest


@frozen
class RunRequest:
    """The files that a run goes into, and what is printed on it: options of `simulate` besides the settings of the run.

    output, plot, stats, checkpoint, resume, events: files, `-` for standard output; columns: patterns of those that
    are written; limit: seconds to find first integrals; digits: with columns of errors; event_rows: with rows at the
    instants of incidents; as_json: the account goes to standard output where that is free.
    """

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
        """Refuse what cannot be done with this MODEL. Raises `BadRequest`, `write_guard.WriteError`."""
        if self.events == "-" and self.to_stdout:
            raise BadRequest(
                "--events -: the rows go to standard output; give -o FILE, or a file for the events"
            )
        if self.digits and self.resume is not None:
            from lagcli.simulation import error_estimate

            raise BadRequest(f"--digits with --resume: {error_estimate.NOT_RESUMED}")
        write_guard.require_endings(
            (self.file, formats.TABLES), (self.events_file, formats.TABLES), (self.plot, formats.FIGURES)
        )
        for option, name, instead in (
            ("--stats", self.stats, "; --json prints the account"),
            ("--checkpoint", self.checkpoint, ""),
            ("--resume", self.resume, ""),
        ):
            if name == "-":
                raise BadRequest(f"{option}: a file name is needed{instead}")
        tables = (("--output", self.file), ("--events", self.events_file))
        others = (
            ("--plot", self.plot),
            ("--stats", self.stats),
            ("--checkpoint", self.checkpoint),
            ("--resume", self.resume),
        )
        files = [
            write_guard.File(option, name, is_written=option != "--resume")
            for option, name in (*tables, *others)
            if name is not None
        ]
        # Those that belong to others
        for option, name in tables:
            if name is None or not atomic_file.is_replaced(pathlib.Path(name)):
                continue
            table = pathlib.Path(os.path.realpath(name))
            derived = [atomic_file.partial_of(table)]
            if self.checkpoint is not None or self.resume is not None:
                # Only here are rows kept, or those that were kept removed.
                from lagcli.output.tables import row_file

                derived.append(row_file.path_of(table))
            for path in derived:
                files.append(write_guard.File(option, os.fspath(path), is_written=True, is_derived=True))
        write_guard.require_writable(
            write_guard.model_file(model), files, frozenset(("--checkpoint", "--resume"))
        )

    def locked(self) -> contextlib.ExitStack:
        """Locks on what a run writes for long, its checkpoint and tables with rows beside them, until it has ended.
        Raises `write_guard.WriteError` where somebody else writes one of them, or the checkpoint that is read."""
        with contextlib.ExitStack() as locks:
            if self.checkpoint is not None or self.resume is not None:
                for name in (self.checkpoint, self.file, self.events_file):
                    if name is not None and atomic_file.is_replaced(pathlib.Path(name)):
                        with write_guard.writing(name):
                            locks.enter_context(atomic_file.FileLock(pathlib.Path(name)))
            if self.resume is not None:
                with write_guard.writing(self.resume):
                    atomic_file.require_free(pathlib.Path(self.resume))
            return locks.pop_all()
