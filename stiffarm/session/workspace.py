"""How stiff an arm is at its tool over the workspace: soft, median and stiff pose, how sure, and what gives way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fem import ArmModel, compliance_budget, directional_stiffness
from robots import InputError, ModelDescription, Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.constants import M_TO_MM
from stiffarm.session.json_text import number
from stiffarm.session.stated import half_widths, propagated, stiffness_interval
from surrogate import default_sweep
from surrogate.designs import space_filling_design

WORKSPACE_POSES: Final = 2000
# Share of the poses that are softer than the one named stiffest.
STIFFEST: Final = 0.95
DOWN: Final = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Spot:
    """One pose: its stiffness along the load (N/mm), the 95 % interval, and the part that gives most there.

    ``low``, ``high``: NaN where nothing is known of the parameters. ``open_names``: what the readings left open and
    what matters here, so that the interval is too narrow. ``tool_mm`` (3,): where the tool is.
    """

    name: str
    q_deg: tuple[float, ...]
    tool_mm: tuple[float, ...]
    stiffness: float
    low: float
    high: float
    part: str
    share: float
    open_names: tuple[str, ...] = ()

    @property
    def has_interval(self) -> bool:
        """Whether anything is known of how sure it is."""
        return bool(np.isfinite(self.low))

    def payload(self, coordinates: tuple[str, ...]) -> dict[str, Any]:
        """For results files."""
        return {
            "stiffness_N_per_mm": number(self.stiffness),
            "interval95_N_per_mm": [number(self.low), number(self.high)] if self.has_interval else None,
            "gives_most": self.part,
            "share": number(self.share),
            "left_open": list(self.open_names),
            "tool_mm": [number(v) for v in self.tool_mm],
            "pose": {name: number(v) for name, v in zip(coordinates, self.q_deg, strict=True)},
        }


@dataclass(frozen=True)
class WorkspaceStiffness:
    """The stiffness (n,) N/mm at n poses of the workspace under a vertical load, ascending, and three looked at.

    ``stiffest``: one in twenty poses is stiffer. Where the load passes through the joints no arm gives way, so the very
    stiffest pose says how finely poses were tried, and nothing about the arm.
    """

    values: Array
    softest: Spot
    median: Spot
    stiffest: Spot

    @property
    def spots(self) -> tuple[Spot, Spot, Spot]:
        """From soft to stiff."""
        return self.softest, self.median, self.stiffest

    @property
    def has_intervals(self) -> bool:
        """Whether the calibration says how sure they are."""
        return all(spot.has_interval for spot in self.spots)

    @property
    def open_names(self) -> tuple[str, ...]:
        """What the readings left open and what matters at any of the three."""
        return tuple(dict.fromkeys(name for spot in self.spots for name in spot.open_names))

    def payload(self, coordinates: tuple[str, ...]) -> dict[str, Any]:
        """For results files."""
        return {"poses": len(self.values)} | {spot.name: spot.payload(coordinates) for spot in self.spots}


def workspace_poses(robot: Robot, count: int = WORKSPACE_POSES) -> tuple[Array, tuple[str, ...]]:
    """Poses (n, dof) rad spread over the workspace, and the coordinates that vary.

    They are scrambled Sobol points with a fixed seed over the coordinates a stiffness map sweeps, within all limits;
    the others stand at zero or at the nearest limit. Equal for equal robots.

    Raises
    ------
    InputError
        No pose can be taken.
    """
    swept, layer = default_sweep(robot)
    names = swept if layer is None else (*swept, layer)
    columns = sorted(robot.coordinate_index(name) for name in names)
    base = np.clip(0.0, robot.limits[:, 0], robot.limits[:, 1])

    def full(Q: Array) -> Array:
        q = np.tile(base, (len(Q), 1))
        q[:, columns] = Q
        return q

    lower, upper = robot.limits[columns].T
    Q = space_filling_design(
        lower,
        upper,
        count,
        np.random.default_rng(0),
        accept=lambda Q: robot.reachable(full(Q)),
        density="uniform",
    )
    return full(Q), tuple(robot.coordinates[i] for i in columns)


def workspace_stiffness(description: ModelDescription, model: ArmModel) -> WorkspaceStiffness:
    """Softest, median and stiffest pose under a vertical load, of those of :func:`workspace_poses`.

    Parameters
    ----------
    description : that the model was built from: its calibration's covariance makes the intervals

    Raises
    ------
    InputError
        No pose can be taken, or nothing deflects under a vertical load.
    """
    poses = workspace_poses(model.robot)[0]
    stiffness = 1e-3 * directional_stiffness(model, poses)
    order = np.argsort(np.where(np.isfinite(stiffness), stiffness, np.inf), kind="stable")
    count = int(np.count_nonzero(np.isfinite(stiffness)))
    if not count:
        raise InputError("stiffness over the workspace: nothing deflects under a vertical load", code="M005")
    rows = order[[0, count // 2, int(STIFFEST * (count - 1))]]
    at, tool = poses[rows], tool_position(model.robot, forward_kinematics(model.robot, poses[rows])) * M_TO_MM
    budget = compliance_budget(model, at, np.array(DOWN))
    half, left_open = _half_widths(description, model, at)
    spots = []
    for k, name in enumerate(("softest", "median", "stiffest")):
        value, e, most = float(stiffness[rows[k]]), float(half[k]), int(np.argmax(budget.share[k]))
        ends = stiffness_interval(value, e)
        spots.append(
            Spot(
                name,
                tuple(np.degrees(at[k]).tolist()),
                tuple(tool[k].tolist()),
                value,
                *ends,
                budget.parts[most],
                float(budget.share[k, most]),
                left_open[k],
            )
        )
    return WorkspaceStiffness(np.sort(stiffness[np.isfinite(stiffness)]), *spots)


def _half_widths(description: ModelDescription, model: ArmModel, q: Array) -> tuple[Array, list[tuple[str, ...]]]:
    """Half-widths (n,) of the 95 % intervals of the compliance over it, NaN if unknown; what was left open at each."""
    try:
        found = propagated(description, model, q)
    except InputError:
        found = None
    if found is None:
        return np.full(len(q), np.nan), [() for _ in q]
    from doe.certainty.propagation import SHARE

    names = [tuple(n for n, s in zip(found.open_names, row, strict=True) if s > SHARE) for row in found.open_share]
    return half_widths(found), names
