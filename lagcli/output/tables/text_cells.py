"""Columns of text among the numbers of a table: a few words that come again and again, such as kinds and names."""

import csv
import io
import json
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import float_text

Texts = Sequence[Sequence[str]]  # for each column of text, in the order of the table, its cells (k,)


def places(columns: Sequence[str], texts: Sequence[str]) -> tuple[int, ...]:
    """The numbers of the columns of text, in the order of the table."""
    return tuple(place for place, name in enumerate(columns) if name in texts)


def parts(rows: NDArray[np.float64], texts: Texts) -> Iterator[tuple[NDArray[np.float64], Texts]]:
    """Rows, shape (k, columns of numbers), and their texts in parts of bounded size."""
    begin = 0
    for part in float_text.slices(rows):
        end = begin + len(part)
        yield part, [column[begin:end] for column in texts]
        begin = end


def quoted(texts: Texts, delimiter: str) -> list[list[bytes]]:
    """The cells as in CSV, quoted where they hold a delimiter, a quote or a line break."""

    def cell(text: str) -> bytes:
        line = io.StringIO()
        csv.writer(line, delimiter=delimiter, lineterminator="\n").writerow([text])
        return line.getvalue()[:-1].encode()

    known = {text: cell(text) for column in texts for text in set(column)}
    return [[known[text] for text in column] for column in texts]


def as_json(texts: Texts) -> list[list[bytes]]:
    """The cells as texts of JSON."""
    known = {text: json.dumps(text, ensure_ascii=False).encode() for column in texts for text in set(column)}
    return [[known[text] for text in column] for column in texts]


def spliced(
    lines: Sequence[bytes], at: Sequence[int], cells: Sequence[Sequence[bytes]], separator: bytes
) -> list[bytes]:
    """Lines of numbers with the cells (columns of text, lines) put in, so that they are the columns `at`."""
    before = at[-1] + 1 - len(at)  # numbers before the last text
    found = []
    for line, *texts in zip(lines, *cells, strict=True):
        words = line.split(separator, before)
        for place, text in zip(at, texts, strict=True):
            words.insert(place, text)
        found.append(separator.join(words))
    return found
