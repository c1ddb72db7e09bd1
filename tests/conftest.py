"""Settings of all tests: what hypothesis tries is the same in every run, and leaves no folder behind."""

import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "repeatable", derandomize=True, database=None, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

# What is started in the background, or under `nohup`, has these ignored, and so have its children.
for name in ("SIGINT", "SIGHUP"):
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)

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
