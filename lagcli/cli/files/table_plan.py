"""A table that a run shall write, and the rows of the run before with which it begins."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.output.tables import cell_text

if TYPE_CHECKING:
    # Rows are kept beside checkpoints, which most runs have none of.
    from lagcli.output.tables.row_file import SafeRows

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class TablePlan:
    """A table that a run shall write.

    option: the option that names its file; file: None for standard output; names: its columns; words: those of its
    columns that hold text, with all texts that may stand there; step: between its rows; has_event_rows: with rows of
    the instants of incidents; noun: of its rows.
    """

    option: str
    file: str | None
    names: tuple[str, ...]
    words: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    step: float = 0.0
    has_event_rows: bool = False
    noun: str = "rows"

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns of text."""
        return tuple(self.words)

    @property
    def path(self) -> pathlib.Path:
        """The file, where there is one."""
        assert self.file is not None
        return pathlib.Path(os.path.realpath(self.file))

    def numbers(self, rows: Floats, texts: cell_text.Texts) -> Floats:
        """Rows as numbers alone, a text as its place among the words, (k, names)."""
        if not self.words:
            return rows
        known = ({word: float(i) for i, word in enumerate(words)} for words in self.words.values())
        coded = {
            name: [places[text] for text in cells]
            for name, cells, places in zip(self.texts, texts, known, strict=True)
        }
        numbers = iter(rows.T)
        columns = [coded[name] if name in coded else next(numbers) for name in self.names]
        return np.array(columns, dtype=float).reshape(len(self.names), len(rows)).T

    def decoded(self, block: Floats) -> tuple[Floats, list[list[str]]]:
        """The rows and the texts of rows as numbers alone."""
        texts = []
        for name, words in self.words.items():
            texts.append([words[int(i)] for i in block[:, self.names.index(name)]])
        kept = [i for i, name in enumerate(self.names) if name not in self.words]
        return block if not self.words else np.ascontiguousarray(block[:, kept]), texts


@dataclasses.dataclass(frozen=True, slots=True)
class RowsBefore:
    """Rows of the run that is resumed, which the same table begins with: their file, and the time they go up to."""

    path: pathlib.Path
    rows: SafeRows
    t_end: float
    noun: str

    @property
    def sentence(self) -> str:
        """The sentence about them."""
        count = self.rows.count
        return f"with the {count} {self.noun} up to t = {self.t_end:.9g} of the run before, from {self.path}"
