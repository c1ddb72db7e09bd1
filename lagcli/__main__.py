"""`lagcli` and `python -m lagcli`."""

from __future__ import annotations

import gc
import os
import sys

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""How the libraries of linear algebra are asked for one thread, before NumPy loads them.

Matrices are small here: the threads of the other cores only wait, which took a quarter of the processor time of a short
run, and the rounding of sums would hang on the number of cores. A user who sets one of them is obeyed."""

MOST_OBJECTS = 50_000
"""Objects between two searches for garbage (Python: 700 to 2 000): loading makes many, and none of them is garbage."""


def main() -> None:
    """The entry point of the command line; it ends in `SystemExit`."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    gc.set_threshold(MOST_OBJECTS)
    try:
        code = _run()
    except KeyboardInterrupt:  # before there was a handler for it
        code = 130
    # What was loaded is taken apart at the end, but not searched for garbage before: that took a sixth of a short run.
    gc.freeze()
    sys.exit(code)


def _run() -> int:
    from lagcli.errors import diagnostics, requirements
    from lagcli.output.files import interrupts

    refusal = requirements.too_old()
    if refusal:
        print(refusal, file=sys.stderr)
        return 2
    try:
        diagnostics.leave_arithmetic_unsaid()
        interrupts.install()
        # Loaded under the signal handlers: an interrupt at start-up is an interrupt and no traceback.
        from lagcli.cli import app

        interrupts.end_promptly()
        code = app.run()
        # The interpreter takes a while to end; an interrupt from now on ends it like any other program.
        interrupts.release()
    except interrupts.Interrupted as interrupt:
        code = 128 + interrupt.number
    return code


if __name__ == "__main__":
    main()
