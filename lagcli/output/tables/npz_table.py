"""Tables as NPZ: a zip archive with one array per column name, for ``numpy.load(..., allow_pickle=False)``.

A column can only be written when all its rows are there, so the rows wait, column by column within each
block, in a temporary file (in memory while they are few). ``numpy.savez`` is not used: it holds the whole
table, and it cannot write a column called ``file``. The comment of the archive holds the provenance: another array
would look like a column.
"""

import json
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import row_buffer, text_cells

_BYTES_IN_MEMORY = 1 << 23  # of rows that wait, before a file is made for them
_MOST_COMMENT = 65_535  # bytes; the format of zip archives has no room for more


class NpzWriter:
    """Writes a table to ``path`` once all its rows have arrived."""

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        texts: Sequence[str] = (),
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        self._comment = _comment(provenance) if provenance is not None else b""
        self._path = path
        self._columns = tuple(columns)
        self._width = len(columns) - len(texts)
        self._texts: dict[str, list[str]] = {name: [] for name in columns if name in texts}
        self._gathered = row_buffer.Gathered(self._width, self._store)
        self._spool = tempfile.SpooledTemporaryFile(  # noqa: SIM115 (closed by finish or abandon)
            max_size=_BYTES_IN_MEMORY, dir=str(path.parent)
        )
        self._lengths: list[int] = []

    def write(self, rows: NDArray[np.float64], texts: text_cells.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the texts beside them."""
        self._gathered.add(rows)
        for kept, cells in zip(self._texts.values(), texts, strict=True):
            kept.extend(cells)

    def finish(self) -> None:
        """Write the archive; its bytes depend on the table alone."""
        self._gathered.flush()
        with self._spool, zipfile.ZipFile(self._path, "w") as archive:
            archive.comment = self._comment
            index = 0
            for name in self._columns:
                # A fixed date, so that equal tables give equal files.
                member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                with archive.open(member, "w", force_zip64=True) as file:
                    if name in self._texts:
                        cells = np.array(self._texts[name][: sum(self._lengths)], dtype="<U")
                        np.lib.format.write_array(file, cells, version=(1, 0), allow_pickle=False)
                        continue
                    shape = (sum(self._lengths),)
                    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
                    np.lib.format.write_array_header_1_0(file, header)
                    for start, length in self._places(index):
                        self._spool.seek(start)
                        file.write(self._spool.read(length))
                index += 1

    def abandon(self) -> None:
        """Remove the temporary file."""
        self._spool.close()

    def _store(self, block: NDArray[np.float64]) -> None:
        # Sought, not merely appended: an interrupted block must be overwritten by the next.
        self._spool.seek(8 * self._width * sum(self._lengths))
        self._spool.write(np.ascontiguousarray(block, "<f8").data)
        self._lengths.append(block.shape[1])

    def _places(self, index: int) -> list[tuple[int, int]]:
        """The place of column ``index`` in the spool: (first byte, bytes) of each block."""
        places = []
        start = 0
        for length in self._lengths:
            places.append((start + 8 * length * index, 8 * length))
            start += 8 * length * self._width
        return places


def _comment(provenance: Mapping[str, object]) -> bytes:
    """The provenance as JSON; what makes it too long, thousands of parameters, is null then."""
    kept = dict(provenance)
    while len(text := json.dumps(kept, allow_nan=False).encode()) > _MOST_COMMENT:
        longest = max(kept, key=lambda name: len(json.dumps(kept[name])))
        kept[longest] = None
    return text
