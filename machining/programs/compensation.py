"""Compensation: the predicted deflection under the cutting force taken off the path, so that the tool ends up on it.

The arm in posture q gives way by ``d = C_tt(q) F``. The commanded point is moved by ``-d``, for which the arm takes
another posture, which gives way by a little more or less; so it is repeated until nothing changes. Statics of the model
only: what the model does not know (backlash, friction, its own error) is not compensated, and a wrong force is
compensated wrongly. The turn of the tool under the force is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fem
from machining.cutting import CuttingForce, ForceAlong, StiffnessUncertainty, SurfaceError, surface_error
from machining.cutting.each_tool import ForceOfEach
from machining.cutting.end_mill import Bending
from machining.cutting.force import along_cuts
from machining.cutting.plunging import with_thrust
from machining.cutting.surface_error import cutting_deflection
from machining.programs.posting import Posted, repost
from machining.task import Task
from machining.toolpaths.engagement import mills, plunges
from robots import InputError, require_at_least, require_positive
from robots.arrays import Array, Bools

# Rounds of the fixed point; a deflection of 1 mm changes itself by some 1e-3 of it each time.
ROUNDS = 12
# Change of the deflection (m) below which it is at rest.
AT_REST = 1e-8
# Compensation that is never exceeded unless the caller says so, m.
CAP = 1e-3
# Way beside a cut over which its correction fades in and out, m.
RAMP = 5e-3


@dataclass(frozen=True, eq=False)
class Compensated:
    """A compensated program.

    ``error``: the deflection that is compensated, at the path's points, with its uncertainty; ``deflection`` (n, 3) m
    at all moves, part axes; ``moved`` (n, 3) m: what was taken off the path; ``capped`` (n,) moves at which the cap was
    reached; ``rounds`` until at rest; ``engaged`` (n,): moves that a force acts on.
    """

    posted: Posted
    error: SurfaceError
    deflection: Array
    moved: Array
    capped: Bools
    rounds: int
    engaged: Bools

    @property
    def left(self) -> Array:
        """Predicted distance (n, 3) m of the tool from the wanted path in its cuts, part axes: 0 but where capped."""
        return np.where(self.engaged[:, None], self.deflection - self.moved, 0.0)


@dataclass(frozen=True, eq=False)
class Acting:
    """A force worked out on the nominal path, that a path moved by micrometres shall not change."""

    found: ForceAlong

    def along(self, task: Task) -> ForceAlong:
        """The force as it was found, whatever the task."""
        return self.found


def compensate(
    model: fem.ArmModel,
    nominal: Posted,
    force: CuttingForce,
    *,
    tool: Bending | None = None,
    stiffness: StiffnessUncertainty | None = None,
    cap: float = CAP,
    ramp: float = RAMP,
) -> Compensated:
    """Take the predicted deflection off a program's path; moves that mill nothing stay, but for the way into a cut.

    Parameters
    ----------
    nominal : a program and what it was made with
    force, tool, stiffness : as in :func:`machining.cutting.surface_error`
    cap : m, no point is moved by more; where more were needed the point is moved by the cap and said to be
    ramp : m of the moves beside a cut over which its correction fades in and out; 0: in one step, within the cut

    Raises
    ------
    InputError
        A cap that is not positive, a path that mills nothing, a deflection that does not come to rest, or a moved path
        that cannot be driven.
    """
    require_positive("cap of the compensation", cap, "m", code="Q008")
    require_at_least("ramp of the compensation", ramp, 0.0, "m", code="Q008")
    wanted = nominal.program.motions.points
    task, (kept, place) = nominal.state.task, nominal.state.places
    acting = Acting(milling_force(force, task, nominal.program.motions.cutting[kept]))
    engaged: Bools = np.asarray(acting.found.force.any(axis=1))[place]
    posted, moved, last = nominal, np.zeros_like(wanted), np.full_like(wanted, np.inf)
    change = np.inf
    for rounds in range(1, ROUNDS + 1):
        here = posted.state.task
        q = posted.program.q[kept]
        deflection = (cutting_deflection(model, here, q, acting.found.force, tool) @ task.T_base_part[:3, :3])[place]
        change = float(np.abs(deflection - last).max(initial=0.0))
        length = np.linalg.norm(deflection, axis=1)
        if change < AT_REST:
            error = surface_error(model, here, q, acting, stiffness=stiffness, tool=tool)
            return Compensated(posted, error, deflection, moved, length > cap, rounds, engaged)
        last = deflection
        moved = deflection * np.minimum(1.0, cap / np.maximum(length, 1e-30))[:, None]
        moved = ramped(moved, engaged, wanted, ramp)
        posted = repost(model, posted, wanted - moved)
    raise InputError(
        "compensation does not come to rest",
        code="Q008",
        value=f"still moves by {change * 1e6:.3g} um after {ROUNDS} rounds",
        allowed=f"less than {AT_REST * 1e6:g} um",
        remedy="check force and stiffness, or keep the path away from singularities",
    )


def milling_force(force: CuttingForce, task: Task, cutting: Bools) -> ForceAlong:
    """The force along a whole program: that of each cut by itself, that of plunges where it is known, else none.

    ``cutting`` (n,): moves at feed, by the point that they lead to.

    Raises
    ------
    InputError
        Nothing is milled; else as the force.
    """
    if isinstance(force, ForceOfEach):
        return force.joined(task, lambda one, part, rows: milling_force(one, part, cutting[rows]))
    cuts, path = cuts_of(task, cutting), task.path
    plunging = plunges(path.points, path.axes, cutting)
    found = along_cuts(force, task, cuts, at_start=False) if cuts else None
    found = with_thrust(found, force, task, plunging)
    return along_cuts(force, task, cuts, at_start=False) if found is None else found


def cuts_of(task: Task, cutting: Bools) -> list[slice]:
    """Runs of points between which the tool mills sideways, each with the point that it starts at."""
    milled = mills(task.path.points, task.path.axes, cutting)[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], milled, [False]]).astype(np.int8)))
    return [slice(int(a), int(b) + 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def ramped(moved: Array, milled: Bools, points: Array, length: float) -> Array:
    """A correction that fades in before each cut and out behind it.

    Parameters
    ----------
    moved : (n, 3) m, the correction where a move mills
    milled : (n,) moves that mill; the point before the first of a cut is where the cut begins
    points : (n, 3) m, uncorrected
    length : m along the path, over which the correction of the nearest cut falls to nothing; 0: in one step

    Returns
    -------
    (n, 3) m: ``moved`` where a move mills. A point where a cut begins has the correction of that cut's first point.
    Between two cuts that are nearer to each other both count, by how near they are.
    """
    out = np.where(milled[:, None], moved, 0.0)
    cuts, others = np.flatnonzero(milled), np.flatnonzero(~milled)
    if not length > 0.0 or not len(cuts) or not len(others):
        return out
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    after = np.searchsorted(cuts, others)
    last, following = cuts[np.maximum(after - 1, 0)], cuts[np.minimum(after, len(cuts) - 1)]
    # The next cut begins at the point before its first move.
    apart = np.stack([way[others] - way[last], way[following - 1] - way[others]])
    exists = np.stack([after > 0, after < len(cuts)])
    weight = np.where(exists, np.clip(1.0 - apart / length, 0.0, 1.0), 0.0)
    weight /= np.maximum(1.0, weight.sum(axis=0))
    out[others] = weight[0][:, None] * moved[last] + weight[1][:, None] * moved[following]
    return np.asarray(out)
