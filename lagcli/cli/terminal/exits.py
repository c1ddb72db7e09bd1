"""Exit codes of the command line, and the one place where a failure becomes one."""

from __future__ import annotations

import contextlib
import os
import sys
import traceback
from collections.abc import Callable, Iterable

from lagcli.errors import diagnostics
from lagcli.input.overrides import OverrideError
from lagcli.output.files import interrupts, write_guard

# Exit codes, as the manual lists them.
DONE, INVALID, USAGE, STOPPED, UNDECIDED, BUG, NOT_WRITTEN, PIPE_CLOSED = 0, 1, 2, 3, 4, 70, 74, 141

# Beginnings of the locations of what stands on the command line and in no file.
OPTIONS = ("--set ", "--mu ", "--of", "--over ", "--reduce ", "--uncertain ")


class Exit(Exception):
    """Exit with this code; all output has been printed."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class UsageError(write_guard.BadRequest):
    """The command line is wrong, or MODEL does not exist."""


def print_err(text: str) -> None:
    """Lines on stderr. A closed stderr is no reason to fail."""
    with contextlib.suppress(OSError, ValueError):
        print(diagnostics.printable(text), file=sys.stderr)


def print_err_all(texts: Iterable[str]) -> None:
    """Each text on stderr."""
    for text in texts:
        print_err(text)


def print_warnings(warnings: Iterable[diagnostics.Diagnostic]) -> None:
    """Warnings on stderr, with their places."""
    print_err_all(warning.render() for warning in warnings)


def print_notes(notes: Iterable[str], quiet: bool) -> None:
    """Notes on stderr, none of a quiet command."""
    print_err_all(f"note: {note}" for note in (() if quiet else notes))


def of(error: diagnostics.ModelError) -> int:
    """The code for an invalid model; where all that is wrong stands in an option, it is the command line's."""
    ours = all(found.location.path.startswith(OPTIONS) for found in error.diagnostics)
    return USAGE if ours else INVALID


def guarded(run: Callable[[], None], debug: bool = False) -> int:
    """Run a command and return its exit code; print to stderr what went wrong."""
    try:
        code = outcome(run)
        # What was printed is written now, while a failure still has an exit code.
        sys.stdout.flush()
        return code
    except interrupts.Interrupted as error:
        print_err_all(interrupts.final_messages())
        # Whoever reads stdout may have stopped to: nothing more is written.
        _drop_stdout()
        return 128 + error.number
    except BrokenPipeError:
        code = PIPE_CLOSED
    except write_guard.WriteError as error:
        print_err(f"lagcli: {error}")
        code = NOT_WRITTEN
    except OSError as error:
        name = error.filename or "standard output"
        print_err(f"lagcli: cannot write {name}: {error.strerror or error}")
        code = NOT_WRITTEN
    except Exception as error:  # noqa: BLE001 - the last resort: any other failure is a bug, reported as such
        if debug:
            traceback.print_exc()
        first = str(error).partition("\n")[0]
        print_err(
            f"lagcli: this is a bug in lagcli ({type(error).__name__}: {first});"
            " please report it with the model file and the output of the same command with --debug"
        )
        code = BUG
    with contextlib.suppress(OSError):
        sys.stdout.flush()
    _drop_stdout()
    return code


def outcome(run: Callable[[], None]) -> int:
    """The code of a command that ended as commands may; any other exception passes."""
    try:
        run()
    except Exit as end:
        return end.code
    except (write_guard.BadRequest, OverrideError) as error:
        print_err(f"lagcli: {error}")
        return USAGE
    except diagnostics.ModelError as error:
        print_err(str(error))
        return of(error)
    return DONE


def _drop_stdout() -> None:
    """Point stdout at nothing: what is left in its buffer would fail again at the interpreter's end."""
    with contextlib.suppress(OSError, ValueError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
