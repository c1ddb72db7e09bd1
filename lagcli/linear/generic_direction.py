"""A direction in the space of coordinates that belongs to no model: the same in every run."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# The first numbers of `default_rng(seed).standard_normal`, written out: a model with few coordinates need not load
# `numpy.random`, which takes a twentieth of the time of its whole run.
_FIRST = {
    0: (
        0.1257302210933933,
        -0.1321048632913019,
        0.6404226504432821,
        0.10490011715303971,
        -0.535669373161111,
        0.36159505490948474,
        1.3040000451301372,
        0.9470809631292422,
        -0.7037352358069926,
        -1.2654214710460525,
        -0.6232744625373522,
        0.0413259793472436,
        -2.3250307746388343,
        -0.21879166393254573,
        -1.2459109472530652,
        -0.7322673547034516,
        -0.5442589828573099,
        -0.31630015636915454,
    ),
    20061: (
        0.49129178558107817,
        -0.04230407025985928,
        -0.07378231962755366,
        1.7061709543652628,
        -1.9779490264518753,
        0.11558012857609463,
        -0.7197777399727312,
        0.8601193331091753,
        -0.7474579380707039,
        0.6124460015477539,
        -0.653073711733803,
        -0.35282732197670613,
        -0.5749081139599276,
        -0.21381254089298296,
        -0.6638662720879077,
        0.24655368592122032,
        -1.059131292911884,
        0.5039254397881155,
    ),
}
# The same of `default_rng(0).choice((-1.0, 1.0))`.
_FIRST_SIGNS = "+++------+++++++++"


def direction(n: int, seed: int) -> Floats:
    """n normally distributed numbers (n,), the first that the generator with this seed gives."""
    first = _FIRST.get(seed, ())
    if n <= len(first):
        return np.array(first[:n])
    return np.random.default_rng(seed).standard_normal(n)


def signs(n: int) -> Floats:
    """n times -1 or 1 (n,), the first that the generator with the seed 0 chooses."""
    if n <= len(_FIRST_SIGNS):
        return np.array([1.0 if sign == "+" else -1.0 for sign in _FIRST_SIGNS[:n]])
    return np.random.default_rng(0).choice((-1.0, 1.0), size=n)
