"""Constraints hold to rounding over a hundred thousand steps."""

import functools

import numpy as np

import lagcli

# Two equal masses that start level with the pivot and whirl for ever.
DOUBLE_PENDULUM = """
lagcli: 1
coordinates: {x1: {value: 1}, z1: {}, x2: {value: 2}, z2: {}}
lagrangian: (rate(x1)**2 + rate(z1)**2 + rate(x2)**2 + rate(z2)**2)/2 - 9.81*(z1 + z2)
holonomic:
  upper: x1**2 + z1**2 = 1
  lower: (x2 - x1)**2 + (z2 - z1)**2 = 1
"""
RTOL, DURATION, ROWS = 1e-8, 2100.0, 2101


@functools.cache
def long_run():
    model = lagcli.loads(DOUBLE_PENDULUM)
    return lagcli.simulate(model, duration=DURATION, samples=ROWS, rtol=RTOL, atol=RTOL / 100)


def test_double_pendulum_stays_on_its_constraints_for_a_hundred_thousand_steps():
    stats = long_run().stats
    assert stats.steps >= 100_000
    assert 0 < stats.position_drift <= 1e-12
    assert 0 < stats.velocity_drift <= 1e-11
    assert stats.energy_imbalance <= 1e-6


def test_account_of_the_drift_is_that_of_the_table():
    table = long_run()
    a, va = (np.stack([table[c.format("x1")], table[c.format("z1")]], axis=1) for c in ("{}", "rate({})"))
    b, vb = (np.stack([table[c.format("x2")], table[c.format("z2")]], axis=1) for c in ("{}", "rate({})"))
    rod, spin = b - a, vb - va
    # |f| / |B| with |B| = 2 at the upper rod and 2 sqrt(2) at the lower one.
    position = np.maximum(
        np.abs((a * a).sum(axis=1) - 1) / 2, np.abs((rod * rod).sum(axis=1) - 1) / np.sqrt(8)
    )
    velocity = np.maximum(np.abs((a * va).sum(axis=1)), np.abs((rod * spin).sum(axis=1)) / np.sqrt(2))
    assert position.max() <= 1e-12
    assert velocity.max() <= 1e-11
    assert abs(position.max() - table.stats.position_drift) <= 1e-15
    assert np.ptp(b[:, 0]) > 3.5
    assert table.t[-1] == DURATION
