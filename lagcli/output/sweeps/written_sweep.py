"""A sweep on its way into a file: its rows come into a journal, and from there into the table; and tables of shards,
merged into the table of the whole sweep."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

from lagcli.output.files import atomic_file, formats, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.sweeps import sweep_journal, sweep_table
from lagcli.output.sweeps.sweep_journal import SweepJournal
from lagcli.output.sweeps.sweep_table import PlannedRows, PointRow, SweepAccount, SweepEnding, SweepTable
from lagcli.output.tables import table_format
from lagcli.output.tables.sinks import Sink

SYNC = 1  # seconds between times that rows are put on the disk for power cuts
MOST_LISTED = 5  # points that are named one by one
UNSEEN = "note: these tables have no column `checksum`: a digit that was changed in them is not seen"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SweepRequest:
    """Options of `sweep` besides what is computed: files, and who computes."""

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

    @property
    def part(self) -> tuple[int, int]:
        """The numbers of `--shard I/N`, 1 of 1 without it. Raises `BadRequest`."""
        if self.shard is None:
            return 1, 1
        number, sign, count = (part.strip() for part in self.shard.partition("/"))
        is_count = sign and number.isdecimal() and count.isdecimal()
        if not is_count or not 1 <= int(number) <= int(count):
            raise BadRequest(f"--shard {self.shard}: write I/N, the part I of N, from 1/N to N/N")
        return int(number), int(count)

    @property
    def path(self) -> Path:
        """The file of this shard."""
        assert self.target is not None
        if self.is_dataset:
            number, count = self.part
            return Path(self.target) / f"part-{number:05d}-of-{count:05d}.parquet"
        return Path(self.target)

    @property
    def rows_so_far(self) -> Path:
        """The name that the rows of an interrupted sweep get, before `.partial`. In a folder it begins with a dot: what
        reads a dataset passes over such files, and over no others."""
        path = self.path
        return path.with_name(f".{path.name}") if self.is_dataset else path

    def require(self, model: str, points: str | None) -> None:
        """Refuse what cannot be done for this MODEL and these points. Raises `BadRequest`, `write_guard.WriteError`."""
        if model == points == "-":
            raise BadRequest("standard input can be read once only: MODEL and --points are both -")
        if self.scheduler is not None and self.jobs != 1:
            raise BadRequest("--jobs and --scheduler both say who computes; give one of them")
        if self.target is None and self.resume:
            raise BadRequest("--resume goes on in the file of the sweep before: give it with -o FILE")
        self._require_stdout()
        if self.target is not None and not self.is_dataset:
            write_guard.require_outputs(model, self.output, None, self.as_json)
            if points not in (None, "-"):
                write_guard.require([("--points", points)], ("--output", self.target, formats.TABLES))

    def require_merge(self, paths: Iterable[str]) -> None:
        """Refuse what cannot be done with the tables of these shards."""
        self._require_stdout()
        if self.target is None:
            return
        if self.is_dataset:
            raise BadRequest(f"--merge: {self.target} is a folder; the parts of a dataset need no merging")
        write_guard.require([("--merge", path) for path in paths], ("--output", self.target, formats.TABLES))

    def _require_stdout(self) -> None:
        if self.target is None and self.as_json:
            raise BadRequest("--json has standard output: give a file for the rows with -o FILE")


# A step on the way: the part of the points that is there, something to tell, and last the ending.
SweepStep: TypeAlias = float | str | SweepEnding


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class WrittenSweep:
    """A sweep and the file of its rows, which are counted in `account`: iterate `steps` once. compute: makes the rows
    of these points in their order, in parts that may be empty."""

    planned: PlannedRows
    request: SweepRequest
    account: SweepAccount
    compute: Callable[[range], Iterator[list[PointRow]]]

    def steps(self) -> Iterator[float | str]:
        """Compute and write, where interrupts are held back; they break off only what computes rows.

        Raises `BadRequest`, `WriteError`, `interrupts.Interrupted`, and what `compute` raises; rows in a file are safe
        then.
        """
        if self.request.target is not None:
            yield from self._to_file()
            return
        with write_guard.writing("standard output"):
            table = SweepTable(sys.stdout.buffer, self.planned.columns, None, self.planned.shard_of)
            for part, rows in self._computed(0):
                with interrupts.shielded(interrupts.PATIENCE):
                    table.write(rows)
                self.account.take(rows)
                yield part
            with interrupts.shielded(interrupts.PATIENCE):
                table.sink.commit(durably=True, planned=len(self.planned.numbers))

    def _computed(self, there: int) -> Iterator[tuple[float, list[PointRow]]]:
        """The rows after those that are there as they are computed, nothing at first, and the part that is there."""
        numbers = self.planned.numbers
        parts = self.compute(numbers[there:])
        rows: list[PointRow] | None = []
        while rows is not None:
            there += len(rows)
            yield there / (len(numbers) or 1), rows
            with interrupts.window():
                rows = next(parts, None)

    def _to_file(self) -> Iterator[float | str]:
        request, planned, target = self.request, self.planned, self.request.path
        path, count = sweep_journal.path_of(target), len(planned.numbers)
        with contextlib.ExitStack() as stack:
            with write_guard.writing(os.fspath(target)):
                target.parent.mkdir(exist_ok=True)
                stack.enter_context(atomic_file.FileLock(target))
            if request.resume:
                digest = sweep_journal.ended_with(path, planned.provenance)
                with write_guard.writing(os.fspath(target)):
                    is_under_way = sweep_journal.is_under_way(path)
                    there = None if is_under_way else _finished_rows(target, planned, digest)
                if there is not None:
                    self.account.take(there)
                    if not request.quiet:
                        yield f"note: {target} holds all rows of this sweep already"
                    return
            with write_guard.writing(os.fspath(path)):
                try:
                    journal = SweepJournal(path, planned.provenance, request.resume)
                except sweep_journal.UnfitJournal as error:
                    raise BadRequest(f"--resume: {error}" if request.resume else str(error)) from None
            stack.callback(journal.close)
            is_resumed = journal.count > 0
            if is_resumed and not request.quiet:
                yield f"note: {journal.count} of {count} points are there of the sweep before"
            yield from self._journal_all(journal)
            with write_guard.writing(os.fspath(target)):
                self._write(
                    journal, target, lambda sink: sink.commit(durably=True, planned=count), self.account.take
                )
                if request.resume and _is_silent(target, planned):
                    journal.end_with(target)
                else:
                    journal.remove()
                if is_resumed:  # what an interrupt has kept of it is in the table
                    atomic_file.partial_of(request.rows_so_far).unlink(missing_ok=True)

    def _journal_all(self, journal: SweepJournal) -> Iterator[float]:
        """Bring the rows that are missing into the journal."""
        synced = time.monotonic()
        try:
            with write_guard.writing(os.fspath(journal.path)):
                for part, rows in self._computed(journal.count):
                    journal.write(rows)
                    if time.monotonic() - synced > SYNC:
                        journal.sync()
                        synced = time.monotonic()
                    yield part
                journal.sync()
        except interrupts.Interrupted:
            # The rows so far go into a file of their own.
            journal.sync()
            target = self.request.rows_so_far
            with write_guard.writing(os.fspath(target)):
                self._write(journal, target, lambda sink: sink.keep_partial(), lambda rows: None)
            done = f"{journal.count} of {len(self.planned.numbers)} points"
            partial = atomic_file.partial_of(target)
            interrupts.leave(f"lagcli: interrupted; {done} are in {partial}; --resume goes on after them")
            raise

    def _write(
        self,
        journal: SweepJournal,
        target: Path,
        end: Callable[[Sink], object],
        seen: Callable[[list[PointRow]], None],
    ) -> None:
        """Write the rows of a journal into a table that is ended so; each block is `seen` when it is written."""
        planned = self.planned
        try:
            table = SweepTable(target, planned.columns, planned.provenance, planned.shard_of)
        except table_format.MissingExtra as error:
            raise BadRequest(str(error)) from None
        with table.sink as sink:
            numbers = iter(planned.numbers)
            for rows in sweep_table.blocks(journal.rows()):
                for row in rows:
                    wanted = next(numbers, None)
                    if row.number != wanted:
                        where = f"stands where that of {wanted} was planned"
                        raise OSError(errno.EIO, f"the row of the point {row.number} {where}")
                table.write(rows)
                seen(rows)
            end(sink)


def _is_silent(path: Path, planned: PlannedRows) -> bool:
    """True if a table of this sweep does not say of which it is: a shard does by its column, a whole sweep by the
    provenance that all formats but CSV and TSV have a place for."""
    return not planned.is_shard and formats.of(path, formats.TABLES) in formats.PLAIN


def _finished_rows(path: Path, planned: PlannedRows, digest: str) -> list[PointRow] | None:
    """The rows of a file that this very sweep has written to its end, or None; digest: of the file that it has ended
    with, where that is known. Raises OSError, and `BadRequest` for all points of a sweep that nothing names."""
    if not path.is_file():
        return None
    is_silent = _is_silent(path, planned)
    try:
        table = table_format.opened(path)
        if tuple(table.columns) != planned.columns:
            return None
        if planned.is_shard and set(table.words(sweep_table.SHARD)) != {planned.shard_of}:
            return None
        if not planned.is_shard and not is_silent:
            wanted = json.loads(json.dumps(planned.identity))  # as it reads back from a file
            if any((table.provenance or {}).get(key) != value for key, value in wanted.items()):
                return None
        finished = sweep_table.rows(path, table, len(planned.names))
    except table_format.UNREADABLE:
        return None  # whatever it is, it is replaced as any file is
    if [row.number for row in finished] != list(planned.numbers):
        return None
    if is_silent and digest != sweep_journal.digest(path):
        raise BadRequest(
            f"--resume: {path} holds a row of every point, and nothing says that these are of this model and its"
            " settings; without --resume all are computed anew"
        )
    return finished


class BadShards(ValueError):
    """Tables that are not the shards of one sweep; the message says why."""


def write_merged(paths: Sequence[str], request: SweepRequest) -> SweepEnding:
    """Put the tables of shards together into the file of a request. Raises `BadRequest`, `write_guard.WriteError`."""
    request.require_merge(paths)
    with contextlib.ExitStack() as locks:
        for path in paths:
            with write_guard.writing(path):
                atomic_file.require_free(Path(path))
        if request.target is not None:
            with write_guard.writing(request.target):
                locks.enter_context(atomic_file.FileLock(Path(request.target)))
        try:
            columns, found, has_checksums = merged(paths)
        except FileNotFoundError as error:
            raise BadRequest(f"--merge: there is no file {error.filename}") from None
        except OSError as error:
            raise BadRequest(f"--merge: cannot read {error.filename}: {error.strerror}") from None
        except (*table_format.UNREADABLE, BadShards) as error:
            raise BadRequest(f"--merge: {error}") from None
        with write_guard.writing(request.output or "standard output"):
            target = sys.stdout.buffer if request.target is None else Path(request.target)
            table = SweepTable(target, columns, None)
            with table.sink as sink:
                for rows in sweep_table.blocks(found):
                    table.write(rows)
                sink.commit(durably=True, planned=len(found))
        account = SweepAccount([], False)
        account.take(found)
        notes = () if has_checksums else (UNSEEN,)
        return SweepEnding(account.code, (*notes, account.sentence()), None)


def merged(paths: Sequence[str]) -> tuple[tuple[str, ...], list[PointRow], bool]:
    """The columns and the rows of all shards, in the order of their points, and whether all rows have checksums, which
    shards of older versions have not.

    Raises `BadShards`, `table_format.UnreadableTable`, `formats.UnknownFormat`, `MissingExtra`, OSError.
    """
    columns: tuple[str, ...] = ()
    sweep, whence, is_checked = "", "", False
    rows: dict[int, PointRow] = {}
    for path in paths:
        names, of, is_summed, found = _read(path)
        if of and sweep and of != sweep:
            raise BadShards(f"{path} is a shard of a different sweep than {whence}")
        if columns and names != columns:
            raise BadShards(f"{path} has other columns than {whence}")
        if columns and is_summed != is_checked:
            raise BadShards(f"{path} and {whence}: one of them has a column `{sweep_table.CHECKSUM}`")
        columns, sweep, whence, is_checked = names, of or sweep, path, is_summed
        for row in found:
            if row.number in rows:
                raise BadShards(f"{path}: the point {row.number} is in another file too")
            rows[row.number] = row
    total = int(sweep.rpartition(" ")[2]) if sweep else 0
    alien = [number for number in rows if not 0 <= number < total]
    if alien:
        raise BadShards(f"the point {alien[0]} is none of the sweep, which has {total}")
    missing = total - len(rows)
    if missing:
        first = itertools.islice((number for number in range(total) if number not in rows), MOST_LISTED)
        listed = ", ".join(map(str, first)) + (", ..." if missing > MOST_LISTED else "")
        raise BadShards(
            f"{missing} of {total} points are missing: {listed}; have all shards run to their end?"
        )
    return columns, [rows[number] for number in sorted(rows)], is_checked


def _read(path: str) -> tuple[tuple[str, ...], str, bool, list[PointRow]]:
    """The columns of the whole sweep, the cell that tells it, whether rows have checksums, and the rows of a shard."""
    table = table_format.opened(path)
    needed = (sweep_table.NUMBER, sweep_table.STATUS, sweep_table.MESSAGE, sweep_table.END, sweep_table.SHARD)
    for name in needed:
        if name not in table.columns:
            raise BadShards(f"{path}: it is no table of a shard: it has no column `{name}`")
    of_shard = (sweep_table.SHARD, sweep_table.CHECKSUM)
    columns = tuple(name for name in table.columns if name not in of_shard)
    cells = sorted(set(table.words(sweep_table.SHARD)))
    if len(cells) > 1 or not all(cell.rpartition(" ")[2].isdecimal() for cell in cells):
        raise BadShards(f"{path}: its rows are not of one sweep")
    is_summed = sweep_table.CHECKSUM in table.columns
    return columns, cells[0] if cells else "", is_summed, sweep_table.rows(Path(path), table, 0)
