"""Doubles as text, the fewest digits that read back to the same double. The only file that imports orjson."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

# The texts of a part, with what is needed to make them, take some 100 bytes a number.
_NUMBERS_AT_ONCE = 1 << 16
_COMMA, _LINE_END = ord(","), ord("\n")
_NULL = b"null"


def require_no_infinity(rows: NDArray[np.float64], columns: Sequence[str]) -> None:
    """ValueError with the name of the first column of ``rows``, shape (k, columns), that has an infinite value.

    What has no value, as a multiplier at its pole, is nan.
    """
    infinite = np.flatnonzero(np.isinf(rows).any(axis=0))
    if infinite.size:
        raise ValueError(f'a table holds no infinite value, as there is in "{columns[infinite[0]]}"')


def slices(rows: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Consecutive slices of ``rows``, shape (k, columns), whose text is of bounded size."""
    step = max(1, _NUMBERS_AT_ONCE // max(1, rows.shape[1]))
    for start in range(0, len(rows), step):
        yield rows[start : start + step]


def csv_lines(rows: NDArray[np.float64]) -> memoryview:
    """``rows``, shape (k, columns) with neither zero: numbers or nan between commas, a line a row."""
    # One list of all the numbers: turning every columns-th comma into a line end keeps the length of the text.
    text = bytearray(orjson.dumps(rows.ravel(), option=orjson.OPT_SERIALIZE_NUMPY).replace(_NULL, b"nan"))
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == _COMMA)[rows.shape[1] - 1 :: rows.shape[1]]
    letters[ends] = letters[-1] = _LINE_END
    return memoryview(text)[1:]


def json_lines(rows: NDArray[np.float64]) -> bytes:
    """``rows``, shape (k, columns), as JSON lists, a line each, with a comma between them; nan is null."""
    text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].replace(b"],[", b"],\n[")


def parsed_json(text: bytes) -> Any:
    """The value of a text of JSON. Raises ValueError, also for numbers beyond all doubles and too deep lists."""
    return orjson.loads(text)
