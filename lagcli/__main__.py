"""`lagcli` and `python -m lagcli`."""

from __future__ import annotations

import sys


def main() -> None:
    """The entry point of the command line; it ends in `SystemExit`."""
    from lagcli.cli import signals

    try:
        signals.install()
        # Loaded under the signal handlers: an interrupt at start-up is an interrupt and no traceback.
        from lagcli.cli import door

        sys.exit(door.run())
    except signals.Interrupted as interrupt:
        sys.exit(128 + interrupt.number)


if __name__ == "__main__":
    main()
