"""Three hundred expressions with known switches: each is found at its place, with its kind, by all who look."""

import functools
import re

import casadi as ca
import numpy as np

import lagcli
from lagcli.equations import operation_rules
from lagcli.equations import system as mechanics
from lagcli.simulation.stepping import timetable
from lagcli.smoothness import jump_search, named_functions, switches, time_functions
from lagcli.smoothness.sides import Sides
from tests.helpers import switch_corpus
from tests.helpers.switch_corpus import CUSP, END, FLAT, JUMP, KINK, NONE, POLE

CASES = list(switch_corpus.cases())
MODEL = "lagcli: 1\ncoordinates: {x: 0.8, y: 0}\nlagrangian: rate(x)**2/2 + rate(y)**2/2\n"
# A root of a square is computed as a modulus.
COMPARING = ("abs(", "sign(", "min(", "max(", "norm(", "distance(", ")**2)")


@functools.cache
def rows():
    """The system with a row `d(y) = expression*d(x)` for each, and the expressions as a column of x."""
    laws = "".join(f'  h{k}: "d(y) = ({case.text})*d(x)"\n' for k, case in enumerate(CASES))
    built = mechanics.build(lagcli.loads(f"{MODEL}differential:\n{laws}"))
    return built, [ca.densify(-value) for value in ca.vertsplit(ca.densify(built.rows.B[:, 0]))]


@functools.cache
def functions():
    """Of each expression functions of x: its value and slope; the ends of its pieces; what is compared with zero."""
    (built, values), found = rows(), []
    x = built.symbols.q[0]
    for value in values:
        arguments = [each.argument for each in switches.among(value, [x])]
        ends = [end for end in arguments if end is not None and ca.depends_on(end, x)]
        lists = [value, ca.gradient(value, x)], ends, switches.compared(value, [x])
        columns = [ca.densify(ca.vertcat(ca.SX(0, 1), *each)) for each in lists]
        found.append(ca.Function("corpus", [x], columns))
    return found


def values_at(number, output, *points):
    return [np.array(functions()[number](x)[output]).ravel() for x in points]


def has_switch(number, output):
    """True if an entry changes its sign at the place that is known, or touches zero there."""
    at = CASES[number].at
    below, there, above = values_at(number, output, at - 1e-7, at, at + 1e-7)
    with np.errstate(invalid="ignore"):
        return bool(((below * above < 0) | (np.abs(there) < 1e-9)).any())


def numbers(*kinds):
    return [k for k, case in enumerate(CASES) if case.kind in kinds]


def texts(found):
    return [CASES[k].text for k in found]


def test_there_are_three_hundred():
    assert len({case.text for case in CASES}) == len(CASES) >= 300


def test_a_switch_is_the_end_of_a_piece():
    assert texts(k for k in numbers(JUMP, KINK, CUSP, END, POLE, FLAT) if not has_switch(k, 1)) == []


def test_a_smooth_function_is_one_piece():
    assert texts(k for k in numbers(NONE) if functions()[k].numel_out(1)) == []


def test_what_is_compared_with_zero_vanishes_at_a_switch():
    is_comparing = [any(word in case.text for word in COMPARING) for case in CASES]
    assert texts(k for k, expected in enumerate(is_comparing) if expected and not has_switch(k, 2)) == []
    assert texts(k for k, ex in enumerate(is_comparing) if not ex and functions()[k].numel_out(2)) == []


def seen(number):
    """The sides of value and slope."""
    offsets = CASES[number].at + np.array([-1e-5, -1e-8, 1e-8, 1e-5])
    return Sides(tuple(values_at(number, 0, *offsets)), np.zeros(2))


def test_the_sides_of_a_switch_tell_its_kind():
    found = {k: [*seen(k).jumps().tolist(), *seen(k).grows().tolist()] for k in range(len(CASES))}
    assert texts(k for k in numbers(JUMP) if not found[k][0]) == []
    assert texts(k for k in numbers(KINK) if found[k][:2] != [False, True]) == []
    assert texts(k for k in numbers(FLAT, NONE) if any(found[k])) == []
    assert texts(k for k in numbers(POLE) if found[k] != [False, False, True, True]) == []
    finite = {k: [np.isfinite(values).all() for values in seen(k).values] for k in numbers(END)}
    assert (
        texts(k for k, each in finite.items() if sorted([each[:2], each[2:]]) != [[False] * 2, [True] * 2])
        == []
    )


def test_the_innermost_function_that_switches_is_named():
    (built, _), wrong = rows(), []
    for k in numbers(JUMP, KINK):
        names, calls = operation_rules.edge_calls(built, k)
        states = [
            calls(0.0, [x, 0.0], [1.0, 0.0], []) for x in CASES[k].at + np.array([-1e-5, -1e-8, 1e-8, 1e-5])
        ]
        sides = Sides(tuple(np.array(state).ravel() for state in states), np.zeros(2 * len(names)))
        hit = (sides.jumps() | sides.ends() | sides.grows()).reshape(2, -1).any(axis=0)
        word = names[int(np.argmax(hit))] if hit.any() else ""
        wrong += [] if word == CASES[k].word else [(CASES[k].text, word)]
    assert wrong == []


def test_a_value_that_jumps_is_found_from_beside():
    (built, values), found = rows(), set()
    inputs = [built.symbols.t, built.symbols.q, built.symbols.v, built.p]
    for k, value in enumerate(values):
        begin = jump_search.starts((0.0, np.array([CASES[k].at + 0.03, 0.0]), np.zeros(2)), np.zeros(0))
        whole = jump_search.Local(value, inputs)
        if any(
            jump_search.jumps(whole, each.argument, inputs, begin)
            for each in jump_search.switches(value, inputs)
        ):
            found.add(k)
    assert texts(set(numbers(JUMP)) - found) == []
    assert texts(found - set(numbers(JUMP))) == []


def in_time(text):
    law = re.sub(r"\bx\b", "t", text)
    return lagcli.loads(f'{MODEL}forces: {{f: {{to: x, force: "{law}"}}}}\n')


def test_a_switch_of_time_ends_a_step():
    """All but the end of `log`, before which forces are infinite."""
    missed = []
    for k in numbers(JUMP, KINK, CUSP, END, POLE, FLAT):
        if CASES[k].word == "log":
            continue
        at = CASES[k].at
        found = timetable.Timetable(time_functions.functions(in_time(CASES[k].text)), 0.0, 0.1)
        h = found.shortened(at - 0.05, 0.1)
        missed += [] if abs(h - 0.05) < 1e-9 else [k]
    assert texts(missed) == []


def test_smooth_functions_of_time_end_no_step():
    functions_of_t = [time_functions.functions(in_time(CASES[k].text)) for k in numbers(NONE)]
    assert [each.switches for each in functions_of_t] == [()] * len(functions_of_t)


def test_models_that_name_what_may_jump_are_told_from_others():
    for case in CASES:
        model = in_time(case.text)
        assert named_functions.have_switching_forces(model) is any(
            word in case.text for word in ("abs(", "sign(", "min(", "max(")
        ), case.text
        if case.kind == JUMP:
            assert named_functions.only_forces_may_jump(model), case.text
