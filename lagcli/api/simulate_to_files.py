"""`lagcli simulate`: a run that is written as it comes, with little of it in memory."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.api.runs import prepare_run, run_settings
from lagcli.model.model import Model
from lagcli.output.files.write_guard import BadRequest
from lagcli.running.run_request import RunRequest
from lagcli.running.written_run import WrittenRun
from lagcli.simulation.run_state import checkpoint


def begin(
    model: Model, settings: Mapping[str, object], request: RunRequest, row: str | None = None
) -> WrittenRun:
    """Return a run that is ready to be written: from its start, from a checkpoint, or from a row of a table.

    settings: what is None is as the model says; row: `FILE` or `FILE:ROW`. Raises `BadRequest`, worded for the options
    of the command, `WriteError` for a file that another run or sweep is writing, and `diagnostics.ModelError`.
    """
    if row is not None and request.resume is not None:
        raise BadRequest("--from with --resume: a run goes on from its checkpoint, and not from a row")
    model = run_settings.of_options(model, settings, row)
    try:
        run = prepare_run.prepare(
            model, model.simulation, request.resume, request.limit, request.digits, may_be_over=True
        )
    except checkpoint.CheckpointError as error:
        raise BadRequest(f"--resume {error}") from None
    except FileNotFoundError:
        raise BadRequest(f"--resume: there is no file {request.resume}") from None
    except OSError as error:
        raise BadRequest(f"--resume: cannot read {request.resume}: {error.strerror}") from None
    return WrittenRun(run, request)
