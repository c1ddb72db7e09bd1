"""Settings of all tests: what hypothesis tries is the same in every run, and leaves no folder behind."""

import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from lagcli.__main__ import MOST_OBJECTS

# Read when numpy is loaded. On small matrices threads of the linear algebra wait for each other more than they work,
# beside other tests most of all; and how a sum is shared among them, and so rounded, depends on the cores there are.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

settings.register_profile(
    "repeatable", derandomize=True, database=None, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

# What is started in the background, or under `nohup`, has these ignored, and so have its children.
for name in ("SIGINT", "SIGHUP"):
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)


def pytest_configure(config: pytest.Config) -> None:
    """The tests start the program hundreds of times. Where Python may write nothing beside the sources, it is compiled
    once into a folder of this run, and not at every start.

    Workers take tests as they stand, so that what the tests of a file share is made once, and at last from each other.
    """
    if getattr(config.option, "dist", None) == "load":
        config.option.dist = "worksteal"
    if os.environ.pop("PYTHONDONTWRITEBYTECODE", None) and "PYTHONPYCACHEPREFIX" not in os.environ:
        folder = tempfile.mkdtemp(prefix="lagcli-compiled-")
        os.environ["PYTHONPYCACHEPREFIX"] = folder
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))


def pytest_collection_finish() -> None:
    """What has been loaded stays to the end: the garbage collector need not go through it again and again, and looks
    at the rest as seldom as in the program."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(MOST_OBJECTS)


ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@pytest.fixture(autouse=True)
def signals_are_left_alone() -> Iterator[None]:
    """What a test leaves ignored would be ignored by the programs that later tests start."""
    before = list(map(signal.getsignal, ENDING))
    yield
    after = list(map(signal.getsignal, ENDING))
    for number, handler in zip(ENDING, before, strict=True):
        signal.signal(number, handler)
    assert after == before
