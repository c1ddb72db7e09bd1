"""The options of `check`, and what is refused about them."""

from __future__ import annotations

import dataclasses

from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.output.files import file_requests


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CheckOptions:
    """Options of `check`; `witness`: the row whose loop is asked for, `plot`: the file of its figure."""

    strict: bool
    assemble: bool
    limit: float
    witness: str | None
    plot: str | None
    as_json: bool
    quiet: bool
    verbose: bool

    def require(self, models: list[str]) -> None:
        """Refuse what cannot be done for these MODELs."""
        model_reading.require_models(models)
        if self.witness is None:
            if self.plot is not None:
                raise exits.UsageError("--plot draws the loop of --witness NAME; give that too")
            return
        if len(models) > 1:
            raise exits.UsageError("--witness takes one MODEL")
        file_requests.require_outputs(models[0], None, self.plot, as_json=False)
