"""Calls from one package of lagcli into another while something runs: properties and generators count, imports do not.

A place that calls again and again, once for each row or block, is one place.
"""

from __future__ import annotations

import contextlib
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType

import lagcli

ROOT = Path(lagcli.__file__).resolve().parent

Places = dict[tuple[str, str], set[str]]


@contextlib.contextmanager
def recorded() -> Iterator[Places]:
    """Inside the block, by packages (caller, called), the places `file:line` of this thread that call."""
    found: Places = defaultdict(set)
    files: dict[CodeType, str] = {}
    stack: list[str] = []  # the files of the frames, nothing for those outside of lagcli
    importing = 0

    def file_of(code: CodeType) -> str:
        if code not in files:
            path = Path(code.co_filename)
            file = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else ""
            # The lazy names of the root, and the making of an object, which is data that is handed on.
            files[code] = "" if file in ("__init__.py", "frozen.py") else file
        return files[code]

    def profile(frame: FrameType, event: str, _: object) -> None:
        nonlocal importing
        is_module = frame.f_code.co_name == "<module>"
        if event == "call":
            file = file_of(frame.f_code)
            importing += is_module
            if file and not importing:
                caller = next((one for one in reversed(stack) if one), "")
                if caller and package(caller) != package(file):
                    found[package(caller), package(file)].add(_place(frame, file_of))
            stack.append("" if importing else file)
        elif event == "return" and stack:
            stack.pop()
            importing -= is_module

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        yield found
    finally:
        sys.setprofile(before)


def package(file: str) -> str:
    """The package of a file, or the module beside the packages."""
    return file.split("/")[0].removesuffix(".py")


def _place(frame: FrameType, file_of: Callable[[CodeType], str]) -> str:
    above = frame.f_back
    while above is not None and not file_of(above.f_code):
        above = above.f_back
    assert above is not None
    return f"{file_of(above.f_code)}:{above.f_lineno}"
