"""Command lines run in this process, with streams of their own."""

import io
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lagcli import __main__ as entry
from lagcli.output.files import interrupts

Command = Callable[..., tuple[str, str, Any]]


def run(*arguments: object) -> tuple[str, str, Any]:
    """Stdout, stderr and the exit code. Signal handlers stay pytest's."""
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="\n") for _ in range(2)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interrupts, "install", lambda: None)
        patch.setattr(sys, "argv", ["lagcli", *map(str, arguments)])
        patch.setattr(sys, "stdout", streams[0])
        patch.setattr(sys, "stderr", streams[1])
        with pytest.raises(SystemExit) as end:
            entry.main()
    for stream in streams:
        stream.flush()
    out, err = (stream.buffer.getvalue().decode() for stream in streams)  # type: ignore[attr-defined]
    return out, err, end.value.code


def completed(
    *arguments: object, folder: Path | None = None, given: str = ""
) -> subprocess.CompletedProcess[str]:
    """As a process in the folder that was given this text would have ended; half a second less."""
    with pytest.MonkeyPatch.context() as patch:
        if folder is not None:
            patch.chdir(folder)
        patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(given.encode()), encoding="utf-8"))
        out, err, code = run(*arguments)
    return subprocess.CompletedProcess([*map(str, arguments)], code or 0, out, err)


@pytest.fixture
def command() -> Command:
    """command(*arguments) -> stdout, stderr and exit code."""
    return run
