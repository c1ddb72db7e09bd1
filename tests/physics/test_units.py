"""The same motion in other units has the same digits."""

import dataclasses

import numpy as np
import pytest

import lagcli


@dataclasses.dataclass(frozen=True)
class Units:
    """What one metre, kilogram, second is, in the units of a model."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def names(self) -> dict[str, float]:
        force = self.mass * self.length / self.time**2
        return {
            "m_": self.length,
            "kg_": self.mass,
            "s_": self.time,
            "N_": force,
            "g_": self.length / self.time**2,
            "u_": self.length / self.time,
            "hz_": 1 / self.time,
            "k_": force / self.length,
            "J_": force * self.length,
        }


SYSTEMS = {
    "nanometres": Units(length=1e-9),
    "micrometres": Units(length=1e-6),
    "kilometres": Units(length=1e3),
    "astronomical": Units(length=1.5e11),
    "light-and-fast": Units(mass=1e-20, time=1e-9),
    "all-mixed": Units(length=3e-10, mass=2e-26, time=5e-13),
}
BOB = """\
particles: {a: {mass: 1*kg_, position: [0, 0, -m_], velocity: [4*u_, 0, 0]}}
forces: {w: {to: a, force: [0, 0, -9.81*g_*m]}}
holonomic: {rod: "distance(a, [0, 0, 0]) = m_"}
"""
# At the origin and at rest; its rod says how long it is.
AT_REST = """\
particles: {a: {mass: 1*kg_, position: [0, 0, 0]}}
forces: {w: {to: a, force: [0, 0, -9.81*g_*m]}}
holonomic: {rod: "distance(a, [m_, 0, 0]) = m_", plane: a.y = 0}
"""
# Nothing has a size before the force moves it.
PUSHED = """\
particles: {a: {mass: 2*kg_, position: [0, 0, 0]}}
forces:
  push: {to: a, force: "[N_*sin(3*hz_*t), 0.2*N_*cos(hz_*t), 0]"}
  spring: {to: a, force: -5*k_*r}
"""
# An angle beside a length, at rest.
CART = """\
coordinates: {x: {value: 0, rate: 0}, th: {value: 1, rate: 0}}
lagrangian: >-
  kg_*rate(x)**2 + kg_*(rate(x)**2 + 2*rate(x)*rate(th)*0.7*m_*cos(th) + (0.7*m_*rate(th))**2)/2
  + 9.81*g_*kg_*0.7*m_*cos(th) - 3*k_*x**2/2
"""
# Angles, a length and particles, with rows between them.
CRANK = """\
coordinates: {th: {value: 0.5, rate: 1*hz_}, s: {value: "m_*(cos(0.5) + sqrt(4 - sin(0.5)**2))"}}
particles:
  pin: {mass: kg_, position: "[m_*cos(th), m_*sin(th), 0]"}
  slide: {mass: 2*kg_, position: [s, 0, 0]}
forces: {w: {to: all, force: [0, -9.81*g_*m, 0]}}
holonomic: {rod: "distance(pin, slide) = 2*m_"}
simulation: {assemble: true}
"""
DISK = """\
coordinates: {x: {}, y: {}, th: {rate: 0.6*hz_}, ph: {rate: 2*hz_}}
lagrangian: kg_*(rate(x)**2 + rate(y)**2)/2 + kg_*m_**2*(rate(th)**2 + 2*rate(ph)**2)/8 - 2*kg_*g_*x
differential:
  along: d(x) = 0.5*m_*cos(th)*d(ph)
  across: d(y) = 0.5*m_*sin(th)*d(ph)
simulation: {assemble: true}
"""
DRIVEN = """\
particles: {bead: {mass: kg_, position: [m_, 0, 0.5*m_], velocity: [0, 3*u_, 0]}}
forces: {w: {to: all, force: [0, 0, -9.81*g_*m]}, drag: {to: all, force: -0.3*kg_*hz_*v}}
holonomic:
  plane: bead.x*sin(3*hz_*t) = bead.y*cos(3*hz_*t)
  ring: bead.x**2 + bead.y**2 + (bead.z - 0.5*m_*cos(hz_*t))**2 = m_**2
"""
CROSSING = """\
particles:
  a: {mass: kg_, position: [0, m_, 0], velocity: [u_, 0, 0]}
  b: {mass: kg_, position: [2*m_, m_, 0], velocity: [u_, 0, 0]}
holonomic:
  crank: norm(a) = m_
  rocker: "distance(b, [2*m_, 0, 0]) = m_"
  rod: distance(a, b) = 2*m_
  flat: a.z = 0
  also: b.z = 0
"""
MODELS = {
    "pendulum": BOB,
    "at-rest": AT_REST,
    "pushed": PUSHED,
    "cart": CART,
    "crank": CRANK,
    "disk": DISK,
    "driven": DRIVEN,
    "crossing": CROSSING,
}


def run(text, units=Units(), **options):
    parameters = ", ".join(f"{name}: {value!r}" for name, value in units.names.items())
    model = lagcli.loads(f"lagcli: 1\nparameters: {{{parameters}}}\n{text}")
    return lagcli.simulate(model, **{"duration": 4 * units.time, "samples": 21, **options})


def kinds(table):
    """The columns of one unit: each coordinate and its rate and reaction, of particles all together."""
    found = {}
    for column in table.columns[1:]:
        owner, _, axis = column.rpartition(".")
        kind = column
        if owner and not column.startswith("lambda."):
            kind = "v" if axis.startswith("v") else {0: "r", 1: "R"}[owner.startswith("R.")]
            kind = column if owner == "R" else kind
        found.setdefault(kind, []).append(column)
    return found


def off(table, other):
    """The largest difference of two tables in parts of the largest value of a kind, by kinds; lambda and R too."""
    found = {}
    for kind, columns in kinds(table).items():
        here, there = (np.array([each[column] for column in columns]) for each in (table, other))
        sizes = np.abs(here).max(), np.abs(there).max()
        # Powers of the units, which are not powers of two, round.
        if sizes[0] > 1e-9 * max(np.abs(table[c]).max() for c in table.columns[1:]) or kind in ("r", "v"):
            found[kind] = (
                float(np.abs(here / sizes[0] - there / sizes[1]).max()) if min(sizes) else max(sizes)
            )
    return found


@pytest.mark.parametrize("system", SYSTEMS.values(), ids=SYSTEMS)
@pytest.mark.parametrize("name", MODELS)
def test_the_same_motion_has_the_same_digits_in_every_unit(name, system):
    here, there = run(MODELS[name]), run(MODELS[name], system)
    differences = off(here, there)
    assert {"pendulum": "lambda.rod", "disk": "lambda.along"}.get(name, there.columns[1]) in {
        *differences,
        *there.columns,
    }
    # Close to where rows are dependent the rounding of positions is amplified in multipliers.
    assert max(differences.values()) < (1e-9 if name == "crossing" else 2e-11), differences
    assert there.stats.steps == pytest.approx(here.stats.steps, rel=0.03, abs=10)
    assert there.stats.singular_times == pytest.approx(
        [t * system.time for t in here.stats.singular_times], rel=1e-9
    )


@pytest.mark.parametrize("length", [2.0**-80, 2.0**30])
@pytest.mark.parametrize("name", ["pendulum", "cart", "disk", "driven"])
def test_in_units_that_are_powers_of_two_it_is_the_same_bit_for_bit(name, length):
    here = run(MODELS[name])
    there = run(MODELS[name], Units(length=length, mass=2.0**40))
    assert there.stats.steps == here.stats.steps
    differences = off(here, there)
    assert max(differences.values()) == 0.0, differences


@pytest.mark.parametrize("length", [1e-12, 1e-18, 1e-25])
def test_no_length_is_too_small(length):
    here, there = run(BOB), run(BOB, Units(length=length))
    assert max(off(here, there).values()) < 1e-10
    assert there.stats.steps < 2 * here.stats.steps


def test_an_absolute_tolerance_that_is_given_is_absolute():
    small = Units(length=1e-9)
    exact = run(BOB, small)
    loose = run(BOB, small, atol=1e-13)
    assert max(off(exact, loose).values()) > 1e-7
    assert run(BOB, small, atol=1e-22).stats.steps == pytest.approx(exact.stats.steps, rel=0.1)
