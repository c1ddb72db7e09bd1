"""`lagcli.derive`: the equations of motion as they are written on paper."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.api import cache, find_modes, run_settings
from lagcli.api.load import Path, as_model
from lagcli.errors import diagnostics
from lagcli.model.model import Model

if TYPE_CHECKING:
    from lagcli.derivation.sections.derivation_page import Derivation


@progress.phase("deriving the equations")
def derive(
    model: Model | Path,
    *,
    solve: bool = False,
    everything: bool = False,
    values: Iterable[str] = (),
    limit: float | None = None,
) -> Derivation:
    """Return the equations of motion as they are written on paper, each line with its number; `print` shows them.

    `solve`: lambda and accelerations in closed form; `everything`: all members of families and all terms of sums;
    `values`: names of parameters that are put in as numbers; `limit`: seconds of this computation. The object has
    `text()`, `latex()`, `markdown()`, `html()`, `as_json()`, and in SymPy `equations()`, `constraints()`,
    `inequalities()` and `system`. Equations of small oscillations are about the declared start, where that is an
    equilibrium or an instant of a steady motion.
    Raises `ModelError`, `ValueError` for a parameter there is not and for a limit that is none.
    """
    seconds = run_settings.seconds(limit)
    # SymPy is not loaded by commands that need none.
    from lagcli import derivation

    model = as_model(model)
    names = [parameter.name for parameter in model.parameters]
    wanted = frozenset(names) if "all" in (given := frozenset(values)) and "all" not in names else given
    if unknown := sorted(wanted.difference(names)):
        hint = diagnostics.nearest(unknown[0], names)
        raise ValueError(f"there is no parameter `{unknown[0]}`{'; ' + hint if hint else ''}")
    system = cache.compiled(model).system
    about = find_modes.of_start(model)
    return derivation.derive(system, derivation.Options(solve, everything, wanted, seconds, about))
