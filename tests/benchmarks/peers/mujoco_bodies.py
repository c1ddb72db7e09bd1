"""MuJoCo: its own bodies, and steps of one length, which settings count.

A chain of rods is one of hinges about the normal of the plane that it moves in, and so has no constraint; Runge-Kutta
of order 4. A rod that closes a loop is an equality of a tendon, and spheres have contacts: both are soft, as stiff as
the steps allow. A disk that rolls by velocities alone has no element here.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import protocol

POINT = 1e-14  # kg m^2: the least inertia of a point mass that is passed on
STIFF = 2.0  # steps that the time constant of an equality takes, the fewest that MuJoCo admits
BOUNCE = 12.0  # steps that a bounce takes
DAMPED = 10.0  # of contacts without rebound: at the critical 1, a force that does not pull leaves an eighth


def build(problem: dict[str, Any]) -> protocol.Solver:
    """A model of MuJoCo."""
    text, settings = KINDS[problem["kind"]](problem)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)

    def prepare(setting: str) -> protocol.Run:
        steps = int(setting.split()[0])
        h = problem["duration"] / steps

        def run() -> Any:
            mujoco.mj_resetData(model, data)
            model.opt.timestep = h
            model.eq_solref[:] = STIFF * h, 1.0
            if problem["kind"] == "spheres":
                # A spring without a damper gives the velocities back.
                spring = -((np.pi / (BOUNCE * h)) ** 2), 0.0
                model.geom_solref[:] = spring if problem["restitution"] else (STIFF * h, DAMPED)
                data.qvel[:].reshape(-1, 3)[:] = problem["velocities"]
            mujoco.mj_step(model, data, nstep=steps)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            places = data.xipos[1:]
            return places[:, [0, 2]] if problem.get("is_plane") else places.ravel()

        return run

    return protocol.Solver(settings, prepare)


def numbers(values: Any) -> str:
    """Numbers of an attribute, to the last digit."""
    return " ".join(repr(float(value)) for value in values)


def network(problem: dict[str, Any]) -> tuple[str, list[str]]:
    """Rods in a row, from a point that is held, in one plane."""
    points = np.array(problem["points"])
    if problem["is_plane"]:
        points = np.insert(points, 1, 0.0, axis=1)
    free = len(points) - len(problem["held"])
    axis = np.cross(points[1] - points[0], [0.0, 0.0, 1.0])
    bodies = ""
    for k in range(1, free + 1):
        before = points[k - 1] - points[max(k - 2, 0)]
        bodies += f'<body pos="{numbers(before if k > 1 else points[0])}">'
        bodies += f'<joint type="hinge" axis="{numbers(axis)}"/>'
        inertia = f'mass="1" diaginertia="{numbers([POINT] * 3)}"'
        bodies += f'<inertial pos="{numbers(points[k] - points[k - 1])}" {inertia}/>'
        bodies += f'<site name="s{k}" pos="{numbers(points[k] - points[k - 1])}"/>'
    bodies += "</body>" * free
    flags, closing = '<flag contact="disable" constraint="disable"/>', ""
    if len(problem["held"]) > 1:
        flags = '<flag contact="disable"/>'
        bodies += f'<site name="end" pos="{numbers(points[-1])}"/>'
        rod = f'<spatial name="rod"><site site="s{free}"/><site site="end"/></spatial>'
        stiff = 'solimp="0.9999 0.9999 0.001 0.5 2"'
        closing = f'<tendon>{rod}</tendon><equality><tendon tendon1="rod" {stiff}/></equality>'
    option = f'<option integrator="RK4" gravity="0 0 -{protocol.GRAVITY}" tolerance="0">{flags}</option>'
    text = f"<mujoco>{option}<worldbody>{bodies}</worldbody>{closing}</mujoco>"
    return text, [f"{64 * 2**k} steps" for k in range(12)]


def spheres(problem: dict[str, Any]) -> tuple[str, list[str]]:
    """Spheres that do not turn, and the walls there are."""
    radius, contact = problem["diameter"] / 2, 'condim="1" solimp="0.9999 0.9999 0.001 0.5 2"'
    # Where spheres do not meet each other, they meet walls alone.
    meets = 'contype="1" conaffinity="1"' if problem["meet"] else 'contype="1" conaffinity="2"'
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = "".join(
        f'<body pos="{numbers(place)}">{slides}<geom type="sphere" size="{radius}" mass="1" {contact} {meets}/></body>'
        for place in problem["places"]
    )
    walls = "".join(
        f'<geom type="plane" size="9 9 1" pos="{numbers(place)}" zaxis="{numbers(normal)}" {contact}'
        ' contype="3" conaffinity="3"/>'
        for place, normal in problem["walls"]
    )
    option = f'<option gravity="0 0 -{problem["gravity"]}" integrator="Euler" cone="elliptic"/>'
    size = '<size memory="64M"/>'
    text = f"<mujoco>{option}{size}<worldbody>{walls}{bodies}</worldbody></mujoco>"
    return text, [f"{steps} steps" for steps in problem["steps"]]


KINDS = {"network": network, "spheres": spheres}


if __name__ == "__main__":
    protocol.serve(build)
