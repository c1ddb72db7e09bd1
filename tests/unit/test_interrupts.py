"""A signal as the lock of a module is let go of, where Python drops exceptions."""

from __future__ import annotations

import importlib._bootstrap as bootstrap
import signal
import types

import pytest

from lagcli.output.files import interrupts


def frame_of_the_callback() -> types.SimpleNamespace:
    """As the frame in which the lock of a module is forgotten."""
    codes = [
        part for part in bootstrap._get_module_lock.__code__.co_consts if isinstance(part, types.CodeType)
    ]
    (code,) = (code for code in codes if code.co_name == "cb")
    return types.SimpleNamespace(f_code=code)


def test_a_signal_that_would_be_dropped_is_raised_later() -> None:
    with interrupts.unwinding():
        interrupts._handle(signal.SIGTERM, frame_of_the_callback())
        with pytest.raises(interrupts.Interrupted):
            interrupts.check()


def test_a_signal_at_any_other_time_is_raised_at_once() -> None:
    with interrupts.unwinding(), pytest.raises(interrupts.Interrupted):
        interrupts._handle(signal.SIGTERM, None)
