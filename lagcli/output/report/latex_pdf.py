"""A page in LaTeX as PDF, by a LaTeX that is installed."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Mapping

PROGRAM = "pdflatex"
SECONDS = 120  # for one page
# No program is started by a document, and no file is read or written outside of its folder; the same document gives the
# same bytes at any time.
SAFE = {
    "openin_any": "p",
    "openout_any": "p",
    "shell_escape": "f",
    "SOURCE_DATE_EPOCH": "0",
    "FORCE_SOURCE_DATE": "1",
}


class LatexFailed(Exception):
    """LaTeX has made no PDF."""


def found() -> str | None:
    """The program, if it is installed."""
    return shutil.which(PROGRAM)


def printed(program: str, document: str, figures: Mapping[str, bytes]) -> bytes:
    """The PDF of a document with figures by the names of their files. Raises `LatexFailed`."""
    with tempfile.TemporaryDirectory(prefix="lagcli-", ignore_cleanup_errors=True) as name:
        folder = pathlib.Path(name)
        (folder / "report.tex").write_text(document, encoding="utf-8")
        for file, content in figures.items():
            (folder / file).write_bytes(content)
        command = [program, "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "report.tex"]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=SECONDS, check=False, stdin=subprocess.DEVNULL,
                cwd=folder, env={**os.environ, **SAFE},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise LatexFailed(f"{program} has not made the page within {SECONDS} s") from None
        except OSError as error:
            raise LatexFailed(f"{program} cannot be started: {error.strerror}") from None
        target = folder / "report.pdf"
        content = target.read_bytes() if target.is_file() else b""
        if done.returncode or not content.startswith(b"%PDF"):
            told = done.stdout.decode(errors="replace").splitlines()
            first = next((line for line in told if line.startswith("!")), f"exit code {done.returncode}")
            raise LatexFailed(f"{program} has made no PDF: {first.lstrip('! ')}")
        return content
