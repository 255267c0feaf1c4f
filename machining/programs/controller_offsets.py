"""Corrections of a calibrated arm in a controller's own terms: joint zeros, robot frame and tool points.

A controller takes zeros of its axes, a base and a tool. It does not take errors of the joints' frames, ratios,
couplings or curves, unless its maker has calibrated the arm: these go into programs (``post --compensate``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from machining.programs.convention import Convention, convention_for, of_the_model
from machining.programs.formats import FORMATS
from machining.programs.orientation import SPOKEN
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.frames import inverse


@dataclass(frozen=True, eq=False)
class ControllerOffsets:
    """What one controller of an arm takes.

    ``formats``: languages of controllers that count so; none: no language does, and angles are those of the model's
    [controller], or its own coordinates for want of that.
    ``axes``: names of its angles; ``zeros_deg`` (dof,): by how much each axis really stands beyond what is shown, NaN
    where that is not known;
    ``T_tracker_robot`` by session (4, 4) m: its robot frame in the tracker's; ``knows_robot_frame``: whether that is
    the controller's, or for want of it the model's base; ``tools`` by target (3,) m in its flange frame.
    """

    formats: tuple[str, ...]
    axes: tuple[str, ...]
    zeros_deg: Array
    T_tracker_robot: Mapping[str, Array]
    knows_robot_frame: bool
    tools: Mapping[str, Array]


def controller_offsets(
    robot: Robot, sessions: Mapping[str, Array], targets: Mapping[str, Array], told: Bools
) -> tuple[ControllerOffsets, ...]:
    """Of every controller whose convention for this arm is known; of the model's own coordinates where none is.

    ``robot``: as calibrated; ``sessions``: the model's base frame (4, 4) m in the tracker's; ``targets`` (3,) m in the
    model's flange frame; ``told`` (dof,): joints whose zeros are known.
    """
    zero = np.zeros(robot.dof) if robot.errors is None else robot.errors.zero
    open_ = np.where(told, 0.0, 1.0)
    known = _conventions(robot)
    out = []
    for formats, convention in known.items():
        if robot.controller is not None:
            axes = robot.controller.names
        else:
            axes = tuple(f"axis {k + 1}" for k in range(robot.dof)) if formats else robot.coordinates
        moved, unknown, at_zero = convention.controller_deg(np.stack([zero, open_, np.zeros(robot.dof)]))
        zeros = np.where(unknown != at_zero, np.nan, moved - at_zero)
        T_base = np.eye(4) if convention.T_base is None else convention.T_base
        back = inverse(convention.T_flange)
        out.append(
            ControllerOffsets(
                formats,
                axes,
                zeros,
                {s: T @ T_base for s, T in sessions.items()},
                convention.T_base is not None,
                {t: back[:3, :3] @ p + back[:3, 3] for t, p in targets.items()},
            )
        )
    return tuple(out)


def _conventions(robot: Robot) -> dict[tuple[str, ...], Convention]:
    """Conventions that are known for this arm, by the languages that have them; else the model's own, without any."""
    found: list[tuple[list[str], Convention]] = []
    for name, language in FORMATS.items():
        if language.neutral:
            continue
        try:
            convention = convention_for(robot, 0, name, None)
        except InputError:
            continue
        same = next((names for names, other in found if other == convention), None)
        if same is None:
            found.append(([name], convention))
        else:
            same.append(name)
    if not found and robot.controller is not None:
        found.append(([], of_the_model(robot.controller, robot.name)))
    if not found:
        same_way: Literal[1] = 1
        found.append(([], Convention(sign=tuple(same_way for _ in range(robot.dof)), offset_deg=(0.0,) * robot.dof)))
    return {tuple(names): convention for names, convention in found}


def orientations(R: Array) -> dict[str, dict[str, float]]:
    """A rotation (3, 3) as each maker writes it: by maker, its angles or quaternion by name."""
    return {one.code: dict(zip(one.columns, one.orientation.write(R[None])[0].tolist(), strict=True)) for one in SPOKEN}
