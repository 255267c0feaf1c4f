"""Which poses to read with a tracker: those that tell geometry and springs best, of poses whose targets it sees.

Poses are chosen one after the other for the largest determinant of what is known of all parameters, frame and targets
among them, beside what was known before (greedy D-optimal design with priors; Fedorov 1972). Derivatives are those of
the calibration, at the arm as the model has it; the scatter is the same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.absolute.calibrate import without_weight
from doe.absolute.chain import Nominal, evaluate, samples
from doe.absolute.identified import NARROWED
from doe.absolute.known import known
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.reduced import FRAME, frame_columns
from doe.absolute.structure import Twin, twins
from doe.absolute.unknowns import Layout, Unknown, unknowns
from doe.absolute.weight import has_weight
from doe.planning.pose_designs import short_tour
from doe.planning.zones import Zone
from fem import ArmModel
from robots import InputError, forward_kinematics
from robots.arrays import Array, Bools, Integers
from robots.progress import Progress, report_progress

USUAL = ("geometry", "springs")
# A retroreflector takes a beam from within this angle about its axis, rad.
ACCEPTS = float(np.radians(30.0))
# The beam keeps so far from the lines through the arm's joints, but for what is this near to the target, m.
CLEAR_m, NEAR_m = 0.12, 0.25
# Nothing is known of the tracker's frame before: m and rad.
OPEN = 10.0
TRIED = 40


@dataclass(frozen=True, eq=False)
class Target:
    """A target on the flange: ``point`` (3,) m, and the ``axis`` (3,) that it looks along; None: from all sides."""

    name: str
    point: Array
    axis: Array | None = None


@dataclass(frozen=True, eq=False)
class Wanted:
    """A campaign to plan: so many ``poses``, ``targets`` on the flange, ``tracker`` (3,) m in the arm's base frame.

    ``free``: names as of a calibration, without error curves; ``sigma`` m: scatter of a coordinate; ``candidates``:
    poses to choose from; ``margin`` rad: kept from the joints' limits.
    """

    poses: int
    targets: tuple[Target, ...]
    tracker: Array
    free: tuple[str, ...] | None = None
    sigma: float = 5e-5
    candidates: int = 600
    payload: Payload | None = None
    zone: Zone = Zone()  # noqa: RUF009 - frozen
    seed: int = 0
    margin: float = float(np.radians(3.0))


@dataclass(frozen=True)
class Expected:
    """What a plan tells of a parameter: its standard deviation in ``unit`` before, by these and by random poses."""

    name: str
    unit: str
    before: float
    sd: float
    random_sd: float

    @property
    def identified(self) -> bool:
        """Whether the calibration would count it as identified."""
        return self.sd < NARROWED * self.before


@dataclass(frozen=True, eq=False)
class PlannedCampaign:
    """Poses (n, dof) rad in an order of short ways, targets ``seen`` (n, t) at each, and what they tell.

    ``candidates``: how many poses there were to choose from; ``twins``: what no poses can tell. ``approach`` (n, dof):
    which way each joint comes to a pose (1 or -1) the first of two times, where lost motion is asked for: the second
    time it comes the other way; else (n, 0), and a pose is come to once.
    """

    wanted: Wanted
    q: Array
    seen: Bools
    approach: Array
    expected: tuple[Expected, ...]
    twins: tuple[Twin, ...]
    candidates: int

    @property
    def readings(self) -> int:
        """How many positions are read."""
        return int(self.seen.sum()) * self.times

    @property
    def times(self) -> int:
        """How often a pose is come to."""
        return 2 if self.approach.size else 1


def plan_campaign(model: ArmModel, wanted: Wanted, progress: Progress | None = None) -> PlannedCampaign:
    """Choose the poses.

    Raises
    ------
    InputError
        Too few poses that the tracker sees, no target, a name that is none or that a plan cannot weigh.
    """
    rng = np.random.default_rng(wanted.seed)
    q, seen = _candidates(model, wanted, rng)
    free = _free(model, wanted)
    data = _data(model, wanted, q, rng.choice([-1.0, 1.0], q.shape))
    layout = Layout(unknowns(model.robot, data, free))
    if not layout.of("reversal"):
        data = replace(data, approach=np.zeros((len(data), 0)))
    if laws := [one.name for one in layout.unknowns if one.law]:
        raise InputError(
            "parameters of a plan",
            code="M001",
            value=", ".join(laws[:3]),
            allowed="parameters without a law of their size",
            remedy="leave periodic and rail out: what tells error curves is angles that are spread, as these are",
        )
    nominal = Nominal(np.array([t.point for t in wanted.targets]), (0.0, 0.0))
    same = twins(model, data, layout, nominal, wanted.seed)
    layout = layout.without([one.name for one in same])
    # The same poses from the other side, where that is asked for.
    both = (data, replace(data, approach=-data.approach)) if data.approach.size else (data,)
    every = [_rows(model, one, layout, nominal, seen, wanted.sigma) for one in both]
    B, sd = np.concatenate([rows for rows, _ in every], axis=1), every[0][1]
    chosen = _greedy(B, wanted.poses, progress)
    some = rng.permutation(len(q))[: wanted.poses]
    after, by_chance = (_sds(B[rows]) * sd for rows in (chosen, some))
    shown = zip(layout.unknowns, sd[FRAME:], after[FRAME:], by_chance[FRAME:], strict=True)
    expected = tuple(Expected(one.name, _unit(one), *_shown(one, *sds)) for one, *sds in shown if one.kind != "target")
    order = chosen[short_tour(q[chosen])]
    return PlannedCampaign(wanted, q[order], seen[order], data.approach[order], expected, same, len(q))


def _unit(one: Unknown) -> str:
    return f"1/({one.unit})" if one.kind == "spring" else one.unit


def _shown(one: Unknown, *sds: float) -> tuple[float, float, float]:
    before, after, chance = (float(one.factor * sd) for sd in sds)
    return before, after, chance


def _free(model: ArmModel, wanted: Wanted) -> Sequence[str]:
    if wanted.free is not None:
        return wanted.free
    payloads = () if wanted.payload is None else (wanted.payload,)
    return USUAL if has_weight(model, payloads) else without_weight(USUAL)


def _candidates(model: ArmModel, wanted: Wanted, rng: np.random.Generator) -> tuple[Array, Bools]:
    """Poses (c, dof) rad that the arm can take, and targets (c, t) that the tracker sees there, one at least."""
    if not wanted.targets:
        raise InputError("targets", code="C005", value="none", allowed="one or more on the flange")
    robot, count = model.robot, max(wanted.candidates, 2 * wanted.poses, 10)
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    low, high = low + wanted.margin, high - wanted.margin
    found, looks, there = [np.zeros((0, robot.dof))], [np.zeros((0, len(wanted.targets)), dtype=np.bool_)], 0
    for _ in range(TRIED):
        q = rng.uniform(np.minimum(low, high), np.maximum(low, high), (count, robot.dof))
        q = q[robot.reachable(q)]
        q = q[wanted.zone.free(robot, q)]
        seen = visible(model, q, wanted.targets, wanted.tracker)
        keep = seen.any(axis=1)
        found.append(q[keep])
        looks.append(seen[keep])
        there += int(keep.sum())
        if there >= count:
            break
    if there < max(2 * wanted.poses, 10):
        raise InputError(
            "poses whose targets the tracker sees",
            code="C005",
            value=f"{there} of {TRIED * count} drawn",
            allowed=f"{max(2 * wanted.poses, 10)} or more, twice as many as are chosen",
            remedy="check --tracker (mm, the arm's base frame) and the targets' directions, or ask for fewer poses",
        )
    q, seen = np.concatenate(found), np.concatenate(looks)
    return q[:count], seen[:count]


def visible(model: ArmModel, q: Array, targets: Sequence[Target], tracker: Array) -> Bools:
    """Which targets (n, t) a tracker at (3,) m sees at poses q (n, dof) rad: within their cone, past the arm."""
    at = forward_kinematics(model.robot, q)
    # The arm as lines through its joints, in points; the flange and what is near the target do not count.
    joints = np.concatenate([at.p, at.p_flange[:, None]], axis=1)
    share = np.linspace(0.0, 1.0, 8)[:, None]
    line = (joints[:, :-1, None] * (1.0 - share) + joints[:, 1:, None] * share).reshape(
        len(q), 8 * (joints.shape[1] - 1), 3
    )
    out = np.ones((len(q), len(targets)), dtype=np.bool_)
    for k, one in enumerate(targets):
        p = at.p_flange + at.R_flange @ one.point
        beam = tracker - p
        length = np.linalg.norm(beam, axis=1)
        unit = beam / np.maximum(length, 1e-9)[:, None]
        if one.axis is not None:
            axis = at.R_flange @ (one.axis / np.linalg.norm(one.axis))
            out[:, k] &= np.einsum("ni,ni->n", axis, unit) >= np.cos(ACCEPTS)
        away = line - p[:, None]
        along = np.einsum("nmi,ni->nm", away, unit)
        off = np.linalg.norm(away - along[:, :, None] * unit[:, None], axis=2)
        blocks = (off < CLEAR_m) & (along > 0.0) & (np.linalg.norm(away, axis=2) > NEAR_m)
        out[:, k] &= ~blocks.any(axis=1) & (length > NEAR_m)
    return out


def _data(model: ArmModel, wanted: Wanted, q: Array, way: Array) -> AbsoluteReadings:
    """Readings of all targets at all poses, come to some ``way`` (n, dof), target by target; nothing is read yet."""
    n, t = len(q), len(wanted.targets)
    none = np.zeros(n * t, dtype=np.int64)
    payload = wanted.payload or Payload(0.0, np.zeros(3))
    return AbsoluteReadings(
        "plan",
        "",
        np.tile(q, (t, 1)),
        np.zeros((n * t, 3)),
        Labels(("",), none),
        Labels(tuple(one.name for one in wanted.targets), np.repeat(np.arange(t), n)),
        none,
        (payload,),
        np.zeros(n * t),
        np.full(n * t, np.nan),
        none,
        approach=np.tile(way, (t, 1)),
    )


def _rows(
    model: ArmModel, data: AbsoluteReadings, layout: Layout, nominal: Nominal, seen: Bools, sigma: float
) -> tuple[Array, Array]:
    """Rows (c, 3 t, p) by pose, over the scatter and times what was known before, sd (p,); unseen targets are 0."""
    there = known(model, layout.unknowns)
    whole = Layout((*layout.unknowns, *there))
    u = np.array([*(one.start for one in layout.unknowns), *there.values()])
    for k, (t, a) in layout.of("target"):
        u[k] = nominal.targets[t, a]
    sd = np.array([*[OPEN] * FRAME, *(one.sd for one in layout.unknowns)])
    parts = []
    for s in samples(model, data, whole, nominal, u):
        P, J = evaluate(model, whole, s, u)
        parts.append(np.concatenate([frame_columns(P), J[: len(layout)]]))
    columns = np.concatenate(parts, axis=2)
    c, t = seen.shape
    B = columns.reshape(len(sd), 3, t, c).transpose(3, 2, 1, 0) * (sd / sigma) * seen[:, :, None, None]
    return np.asarray(B.reshape(c, 3 * t, len(sd))), sd


def _greedy(B: Array, count: int, progress: Progress | None) -> Integers:
    """Poses (count,), each the one that tells most beside those before it."""
    V, chosen = np.eye(B.shape[2]), list[int]()
    for k in range(count):
        BV = B @ V
        gain = np.linalg.slogdet(np.eye(B.shape[1]) + BV @ np.swapaxes(B, 1, 2))[1]
        gain[chosen] = -np.inf
        best = int(np.argmax(gain))
        chosen.append(best)
        K = np.linalg.solve(np.eye(B.shape[1]) + BV[best] @ B[best].T, BV[best])
        V = V - BV[best].T @ K
        V = 0.5 * (V + V.T)
        report_progress(progress, k + 1, count)
    return np.array(chosen, dtype=np.int64)


def _sds(B: Array) -> Array:
    """Standard deviations (p,) after rows (n, m, p), as shares of those before."""
    R = np.linalg.qr(np.vstack([B.reshape(-1, B.shape[2]), np.eye(B.shape[2])]), mode="r")
    return np.asarray(np.linalg.norm(np.linalg.inv(R), axis=1))
