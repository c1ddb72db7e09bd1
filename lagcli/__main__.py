"""`lagcli` and `python -m lagcli`."""

from __future__ import annotations

import sys


def main() -> None:
    """The entry point of the command line."""
    from lagcli.cli import app, signals

    signals.install()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # Names and titles may hold any letter; a terminal that cannot show one gets an escape, no failure.
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")
    try:
        app.app(prog_name="lagcli")
    except signals.Interrupted as interrupt:
        sys.exit(128 + interrupt.number)


if __name__ == "__main__":
    main()
