"""A Dask cluster as an engine: its scheduler hands parts to workers, and again where a worker dies."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from lagcli.api.sweeps.engines import Engine

PATIENCE = 10.0  # seconds for the scheduler to answer
# Workers that may die over one part before it is taken to be the part that ends them.
MOST_DEATHS = 10


class NoCluster(RuntimeError):
    """There is no cluster at the address, or no Dask here; the message says which."""


@contextlib.contextmanager
def cluster(address: str) -> Iterator[Engine]:
    """The cluster whose scheduler has this address, `tcp://HOST:PORT`. Raises `NoCluster`."""
    try:
        import dask
        import distributed
    except ModuleNotFoundError as error:
        raise NoCluster('a cluster needs Dask, which is not installed: pip install "lagcli[dask]"') from error
    dask.config.set({"distributed.scheduler.allowed-failures": MOST_DEATHS})
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise NoCluster(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        workers = sum(client.ncores().values())
        # Workers may come later; the scheduler hands out what waits.
        executor = client.get_executor(pure=False, retries=MOST_DEATHS)
        yield Engine(executor, max(1, workers), deadly=(distributed.KilledWorker,))
