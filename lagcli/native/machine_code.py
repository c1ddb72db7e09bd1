"""Machine code of a module by llvmlite: made once, kept in the user's folder, called by addresses.

No optimization that changes bits is on: no fast math, no contraction, no vectors across independent sums.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import casadi as ca

from lagcli.errors import requirements
from lagcli.native import object_folder
from lagcli.native.paying import LIBRARY


class Level(IntEnum):
    """How code is made: soonest, or so that it runs up to 1.6 times as fast and takes two to six times as long to
    make."""

    SOON = 0
    BEST = 1


SOON, BEST = Level
# Instructions that round a product and a sum once. LLVM makes none of what is written as two operations, and here could
# not; where they belong to the processor's first ones it knows no such name.
FUSED = ("fma", "fma4")


def is_installed() -> bool:
    """True if native code can be made here."""
    return find_spec(LIBRARY) is not None and not requirements.too_old([LIBRARY])


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm  # loaded where native code pays

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


@cache
def _processor() -> dict[str, str]:
    """The processor at hand, and what it can do; the bits are the same on each. Of a general kind where LLVM does not
    know it."""
    llvm = _llvm()
    try:
        features = llvm.get_host_cpu_features()
    except RuntimeError:
        return {}
    for fused in FUSED:
        if fused in features:
            features[fused] = False
    return {"cpu": llvm.get_host_cpu_name(), "features": features.flatten()}


def _machine(level: int) -> Any:
    target = _llvm().Target.from_default_triple()
    return target.create_target_machine(opt=level, jit=True, **_processor())


@cache
def _sources() -> bytes:
    """The files that make text of functions: other files may make other text of the same functions."""
    return b"".join(file.read_bytes() for file in sorted(Path(__file__).parent.glob("*.py")))


def key(functions: Sequence[ca.Function], text: str) -> tuple[str, int]:
    """The name of the code of functions, and of further text that calls them, on this processor; and the bytes
    of the functions as CasADi writes them."""
    llvm, packed = _llvm(), ca.StringSerializer()
    for function in functions:
        packed.pack(function)
    versions = (
        f"{llvm.llvm_version_info} {llvm.get_default_triple()} {_processor()} {ca.CasadiMeta.version()}"
    )
    content = packed.encode().encode()
    return object_folder.key([content, text.encode(), versions.encode(), _sources()]), len(content)


def made(text: str, level: int) -> bytes:
    """The object file of a module's text."""
    llvm = _llvm()
    module, machine = llvm.parse_assembly(text), _machine(level)
    return bytes(machine.emit_object(module))


class MachineCode:
    """The functions of an object file."""

    def __init__(self, code: bytes) -> None:
        llvm = _llvm()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine(SOON))
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def number(self, name: str) -> int:
        """A number that it holds."""
        return ctypes.c_int64.from_address(self._engine.get_global_value_address(name)).value

    def function(self, name: str) -> Callable[[ctypes.Array[ctypes.c_void_p]], None]:
        """A function of one table of addresses; others run while it does."""
        function: Any = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(self._engine.get_function_address(name))
        function.code = self  # which lives as long
        return cast("Callable[[ctypes.Array[ctypes.c_void_p]], None]", function)
