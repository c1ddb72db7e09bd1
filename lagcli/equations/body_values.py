"""What the table shows of bodies and joints: centres, orientations and angular velocities, and the reactions of joints.

omega = sum_j e_j x e_j' / 2 with the axes e_j of a body; force and torque of a joint on a body are those of the forces
B^T lambda of its rows on the particles of the body, about the place of the joint.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from lagcli.equations.environment import Environment
from lagcli.model import model as nouns
from lagcli.model.bodies import AXES, PLANE, weight


def values(model: nouns.Model, env: Environment, r: ca.SX, v: ca.SX, forces: dict[str, ca.SX]) -> ca.SX:
    """Their values; r, v (3 N,) of all particles, forces: of each joint B^T lambda of its rows by particles (3 N,)."""
    found: list[ca.SX] = []
    r, v = (ca.reshape(x, 3, x.numel() // 3) for x in (r, v))
    for body in model.bodies:
        own, moving = r[:, list(body.particles)], v[:, list(body.particles)]
        P = len(body.particles)
        found += [ca.sum2(own) / P, ca.sum2(moving) / P]
        if P > 2:
            axes = [_direction(env, body.base, word, own, moving) for word in AXES]
            E, E_dot = (ca.horzcat(*parts) for parts in zip(*axes, strict=True))
            omega = sum((ca.cross(E[:, j], E_dot[:, j]) for j in range(3)), ca.SX(3, 1)) / 2
            found += [quaternion(E), omega]
    for joint in model.joints:
        name, numbers = joint.body.base, list(joint.body.particles)
        own, F = r[:, numbers], ca.reshape(forces[joint.name], 3, r.shape[1])[:, numbers]
        if joint.built_in is not None:
            weights, normal = ca.SX(ca.DM(joint.built_in[0])), ca.SX(joint.built_in[1])
        else:
            weights = ca.vertcat(
                *(_constant(env, weight(name, joint.word, k)) for k in range(1, len(numbers) + 1))
            )
            normal = _constant(env, weight(name, joint.word, "n")) if len(numbers) == 3 else ca.SX(0)
        place = ca.mtimes(own, weights)
        if len(numbers) == 3:
            a, b = (_plane(env, name, word, own) for word in PLANE)
            place += normal * ca.cross(a, b)
        torque = sum((ca.cross(own[:, k] - place, F[:, k]) for k in range(len(numbers))), ca.SX(3, 1))
        found += [joint.sign * ca.sum2(F), joint.sign * torque]
    return ca.densify(ca.vertcat(*found)) if found else ca.SX(0, 1)


def _plane(env: Environment, body: str, word: str, own: ca.SX) -> ca.SX:
    weights = (_constant(env, weight(body, word, k)) for k in range(1, own.shape[1] + 1))
    return ca.mtimes(own, ca.vertcat(*weights))


def _constant(env: Environment, name: str) -> ca.SX:
    value = env.constant(name)
    assert isinstance(value, ca.SX), name
    return value


def _direction(env: Environment, body: str, word: str, own: ca.SX, moving: ca.SX) -> tuple[ca.SX, ca.SX]:
    """An axis of a body, and its rate."""
    e, e_dot = _plane(env, body, word, own), _plane(env, body, word, moving)
    if own.shape[1] == 3:
        normal = _constant(env, weight(body, word, "n"))
        (a, b), (a_dot, b_dot) = ([_plane(env, body, w, x) for w in PLANE] for x in (own, moving))
        e = e + normal * ca.cross(a, b)
        e_dot = e_dot + normal * (ca.cross(a_dot, b) + ca.cross(a, b_dot))
    return e, e_dot


def quaternion(R: ca.SX) -> ca.SX:
    """The quaternion (4,) of a rotation, w first and not negative, from the largest of its squares (Shepperd)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    squares = [1 + trace, *(1 - trace + 2 * R[i, i] for i in range(3))]
    lines: Sequence[Sequence[ca.SX]] = (
        (squares[0], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]),
        (R[2, 1] - R[1, 2], squares[1], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]),
        (R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], squares[2], R[1, 2] + R[2, 1]),
        (R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], squares[3]),
    )
    largest, found = squares[0], ca.vertcat(*lines[0])
    for square, line in zip(squares[1:], lines[1:], strict=True):
        found = ca.if_else(square > largest, ca.vertcat(*line), found)
        largest = ca.fmax(square, largest)
    found = found / ca.norm_2(found)
    return ca.if_else(found[0] < 0, -found, found)
