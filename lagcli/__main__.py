"""`lagcli` and `python -m lagcli`."""

from __future__ import annotations

import gc
import sys


def main() -> None:
    """The entry point of the command line; it ends in `SystemExit`."""
    try:
        code = _run()
    except KeyboardInterrupt:  # before there was a handler for it
        code = 130
    # What was loaded is taken apart at the end, but not searched for garbage before: that took a sixth of a short run.
    gc.freeze()
    sys.exit(code)


def _run() -> int:
    from lagcli import requirements
    from lagcli.cli.terminal import signals

    refusal = requirements.too_old()
    if refusal:
        print(refusal, file=sys.stderr)
        return 2
    try:
        signals.install()
        # Loaded under the signal handlers: an interrupt at start-up is an interrupt and no traceback.
        from lagcli.cli import entry
        from lagcli.cli.terminal import prompt_end

        prompt_end.start()
        code = entry.run()
        # The interpreter takes a while to end; an interrupt from now on ends it like any other program.
        signals.release()
    except signals.Interrupted as interrupt:
        code = 128 + interrupt.number
    return code


if __name__ == "__main__":
    main()
