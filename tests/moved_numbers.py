"""Every number of an algorithm moved by ten, both ways, beside the tests that its docstring names.

`python -m tests.moved_numbers [FILE ...]` looks at the files of `lagcli`, or at those given, and lists the numbers that
no named test notices. Each is moved in a process of its own, which is forked: about a second for each.
"""

from __future__ import annotations

import ast
import importlib
import os
import sys
import types
from typing import Any

import pytest

from tests.helpers.parameter_objects import defined_in, fields, files_named, named_in, parameter_objects

# Seconds of a processor; a number may be moved to where an iteration does not end.
MOST_SECONDS = 60


def moved(value: Any, factor: float) -> Any:
    """The value times the factor; of several each."""
    if isinstance(value, tuple):
        return tuple(moved(each, factor) for each in value)
    return type(value)(value * factor) if isinstance(value, int | float) else value


def set_number(module: types.ModuleType, owner: type, name: str, value: object) -> None:
    """Move a number, where it is a default of an argument too."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    scopes = [module, *(each for each in vars(module).values() if isinstance(each, type))]
    for function in (each for scope in scopes for each in vars(scope).values()):
        if isinstance(function, types.FunctionType) and function.__defaults__:
            function.__defaults__ = tuple(value if each is before else each for each in function.__defaults__)


def fails(module: types.ModuleType, owner: type, name: str, value: object, tests: list[str]) -> bool:
    """True if tests fail, or do not end, with another value of a number."""
    child = os.fork()
    if child == 0:
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS))
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        set_number(module, owner, name, value)
        os._exit(int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests])))
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, 1) or status < 0, f"{name}: the tests {tests} were not run"
    return status != 0


def unnoticed(file: str, node: ast.ClassDef) -> list[str]:
    """The fields of an object that may be moved without a named test that fails."""
    module = importlib.import_module("lagcli." + file.removesuffix(".py").replace("/", "."))
    owner, found = getattr(module, node.name), []
    own = files_named(ast.get_docstring(node) or "")
    for name, docstring in fields(node):
        files = [*own, *files_named(docstring)]
        wanted = set(named_in(docstring))
        holding = [each for each in files if defined_in(each) & wanted]
        tests = [*dict.fromkeys(holding), "-k", " or ".join(sorted(wanted))]
        value = getattr(owner, name)
        if not any(fails(module, owner, name, moved(value, factor), tests) for factor in (10, 0.1)):
            found.append(name)
    return found


def main(only: list[str]) -> int:
    """Look at all objects, or at those of some files; the number of fields that no test notices."""
    count, objects = 0, list(parameter_objects())
    for each in only:
        if not any(each.endswith(file) for file, _ in objects):
            sys.exit(f"{each}: there is no file of lagcli with numbers of an algorithm of this name")
    for file, node in objects:
        if not only or any(each.endswith(file) for each in only):
            for name in unnoticed(file, node):
                print(f"{file}: no named test notices {node.name}.{name}", flush=True)
                count += 1
    return count


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
