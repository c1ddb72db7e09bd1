"""Exit codes of the specification, and the one place where a failure becomes one."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from lagcli import diagnostics
from lagcli.cli import signals
from lagcli.reader.overrides import OverrideError

DONE, INVALID, USAGE, STOPPED, UNDECIDED, BUG, NOT_WRITTEN = 0, 1, 2, 3, 4, 70, 74
PIPE_CLOSED = 141


class Exit(Exception):
    """Ends the command with a code; everything there is to say has been said."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class UsageError(Exception):
    """The command line is wrong, or MODEL does not exist."""


class WriteError(Exception):
    """A file could not be written."""


def say(text: str) -> None:
    """A line on stderr. A closed stderr is no reason to fail."""
    with contextlib.suppress(OSError, ValueError):
        print(diagnostics.printable(text), file=sys.stderr)


Command = TypeVar("Command", bound=Callable[..., None])


def command(function: Command) -> Command:
    """Give a command its exit code: it always ends in `SystemExit`."""

    @functools.wraps(function)
    def ended(*arguments: Any, **options: Any) -> None:
        code = guarded(lambda: function(*arguments, **options), debug=bool(options.get("debug")))
        raise SystemExit(code)

    return ended  # type: ignore[return-value] # the same parameters, by functools.wraps


def guarded(run: Callable[[], None], debug: bool = False) -> int:
    """Run a command and return its exit code; say on stderr what went wrong."""
    try:
        run()
        sys.stdout.flush()
    except Exit as exit_:
        return _flushed(exit_.code)
    except (UsageError, OverrideError) as error:
        say(f"lagcli: {error}")
        return USAGE
    except diagnostics.ModelError as error:
        say(str(error))
        return INVALID
    except signals.Interrupted as error:
        return 128 + error.number
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        _close_stdout()
        return PIPE_CLOSED
    except WriteError as error:
        say(f"lagcli: {error}")
        return NOT_WRITTEN
    except OSError as error:
        say(f"lagcli: {_os_message(error)}")
        return NOT_WRITTEN
    except Exception as error:  # noqa: BLE001 - the last resort: any other failure is a bug, reported as such
        return _bug(error, debug)
    return DONE


def _flushed(code: int) -> int:
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _close_stdout()
        return PIPE_CLOSED
    return code


def _os_message(error: OSError) -> str:
    name = f" {error.filename}" if error.filename else ""
    return f"cannot write{name}: {error.strerror or error}"


def _close_stdout() -> None:
    """Point stdout at nothing, so that the interpreter does not complain of the closed pipe at its end."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _bug(error: Exception, debug: bool) -> int:
    if debug:
        traceback.print_exc()
    say(
        f"lagcli: this is a bug in lagcli ({type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''});"
        " please report it with the model file and the output of the same command with --debug"
    )
    return BUG


def errors_as_json(error: diagnostics.ModelError) -> str:
    """The object of `--json` for an invalid model."""
    return json.dumps({"errors": [d.as_json() for d in error.diagnostics]}, ensure_ascii=False)
