"""`lagcli` and `python -m lagcli`."""

from __future__ import annotations

import sys


def main() -> None:
    """The entry point of the command line; it ends in `SystemExit`."""
    try:
        code = _run()
    except KeyboardInterrupt:  # before there was a handler for it
        code = 130
    sys.exit(code)


def _run() -> int:
    from lagcli import requirements
    from lagcli.cli import signals

    refusal = requirements.too_old()
    if refusal:
        print(refusal, file=sys.stderr)
        return 2
    try:
        signals.install()
        # Loaded under the signal handlers: an interrupt at start-up is an interrupt and no traceback.
        from lagcli.cli import entry, prompt_end

        prompt_end.start()
        code = entry.run()
        # The interpreter takes a while to end; an interrupt from now on ends it like any other program.
        signals.release()
    except signals.Interrupted as interrupt:
        code = 128 + interrupt.number
    return code


if __name__ == "__main__":
    main()
