"""An HTML page as PDF, printed by a browser that is installed."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import tempfile

# Chromium and its relatives print without a window by the same options; Firefox and Safari have none for it.
BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge",
    "microsoft-edge", "microsoft-edge-stable", "brave-browser",
)  # fmt: skip
# Browsers that stand in no folder of the path.
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    "%ProgramFiles%\\Google\\Chrome\\Application\\chrome.exe",
    "%ProgramFiles(x86)%\\Google\\Chrome\\Application\\chrome.exe",
    "%ProgramFiles(x86)%\\Microsoft\\Edge\\Application\\msedge.exe",
)
SECONDS = 120  # for one page: a browser that waits for a display or a question waits for ever


class NoBrowser(Exception):
    """There is no browser that prints, or it has printed nothing."""


def is_there() -> bool:
    """True if there is a browser that prints."""
    try:
        found()
    except NoBrowser:
        return False
    return True


def found() -> str:
    """The program that prints. Raises `NoBrowser` with what to install."""
    for name in BROWSERS:
        if (program := shutil.which(name)) is not None:
            return program
    for place in map(os.path.expandvars, PLACES):
        if os.path.isfile(place):
            return place
    raise NoBrowser(
        "a PDF is printed by Chromium, Google Chrome or Microsoft Edge, and none is installed; install one, or"
        " write report.html and print it from any browser"
    )


def printed(page: str) -> bytes:
    """The PDF of an HTML page. Raises `NoBrowser`."""
    program = found()
    with tempfile.TemporaryDirectory(prefix="lagcli-", ignore_cleanup_errors=True) as name:
        folder = pathlib.Path(name)
        source, target = folder / "report.html", folder / "report.pdf"
        source.write_text(page, encoding="utf-8")
        command = [
            program,
            "--headless",
            "--disable-gpu",
            "--no-first-run",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder / 'profile'}",
            f"--print-to-pdf={target}",
            source.as_uri(),
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            # Chromium refuses to start its sandbox for root. The page holds no script, and its policy forbids any.
            command.insert(1, "--no-sandbox")
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=SECONDS, check=False, stdin=subprocess.DEVNULL
            )
        except subprocess.TimeoutExpired:
            raise NoBrowser(f"{program} has not printed the page within {SECONDS} s") from None
        except OSError as error:
            raise NoBrowser(f"{program} cannot be started: {error.strerror}") from None
        content = target.read_bytes() if target.is_file() else b""
        if not content.startswith(b"%PDF"):
            raise NoBrowser(f"{program} has printed nothing (exit code {done.returncode})")
        return content
