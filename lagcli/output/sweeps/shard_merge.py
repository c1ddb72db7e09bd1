"""Tables of shards, merged into the table of the whole sweep."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path

from lagcli.output.files import file_lock, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.sweeps import sweep_table
from lagcli.output.sweeps.sweep_table import PointRow, SweepAccount, SweepEnding, SweepTable
from lagcli.output.sweeps.written_sweep import SweepRequest
from lagcli.output.tables import table_format

MOST_LISTED = 5  # points that are named one by one
UNSEEN = "note: these tables have no column `checksum`: a digit that was changed in them is not seen"


class BadShards(ValueError):
    """Tables that are not the shards of one sweep; the message says why."""


@dataclasses.dataclass(frozen=True, slots=True)
class MergedRows:
    """The rows of a whole sweep, in the order of its points, with the columns of their table.

    has_checksums: every row was compared with its own, which shards of older versions have not.
    """

    columns: tuple[str, ...]
    rows: list[PointRow]
    has_checksums: bool


def write(paths: Sequence[str], request: SweepRequest) -> SweepEnding:
    """Put the tables of shards together into the file of a request.

    Raises `BadRequest`, and `write_guard.WriteError`, for a file of these too that a sweep is writing.
    """
    request.require_merge(paths)
    with contextlib.ExitStack() as locks:
        for path in paths:
            with write_guard.writing(path):
                file_lock.require_free(Path(path))
        if request.target is not None:
            with write_guard.writing(request.target):
                locks.enter_context(file_lock.FileLock(Path(request.target)))
        try:
            found = merged(paths)
        except FileNotFoundError as error:
            raise BadRequest(f"--merge: there is no file {error.filename}") from None
        except OSError as error:
            raise BadRequest(f"--merge: cannot read {error.filename}: {error.strerror}") from None
        except (*table_format.UNREADABLE, BadShards) as error:
            raise BadRequest(f"--merge: {error}") from None
        with write_guard.writing(request.output or "standard output"), contextlib.ExitStack() as stack:
            target = sys.stdout.buffer if request.target is None else Path(request.target)
            table = SweepTable(target, found.columns, None)
            stack.callback(table.sink.discard)
            for rows in sweep_table.blocks(found.rows):
                table.write(rows)
            stack.pop_all()
            table.sink.commit(durably=True, planned=len(found.rows))
        account = SweepAccount([], False)
        account.take(found.rows)
        notes = () if found.has_checksums else (UNSEEN,)
        return SweepEnding(account.code, (*notes, account.sentence()), None)


def merged(paths: Sequence[str]) -> MergedRows:
    """The rows of all shards, whatever their order and their formats.

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
    return MergedRows(columns, [rows[number] for number in sorted(rows)], is_checked)


def _read(path: str) -> tuple[tuple[str, ...], str, bool, list[PointRow]]:
    """The columns of the whole sweep, the cell that tells it, whether its rows have checksums, and the rows of a
    shard."""
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
