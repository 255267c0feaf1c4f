"""Frames and targets to begin with, in closed form, whatever part of the readings is wrong.

With the described arm, ``R^T position - R^T t - R_flange o = p_flange + x way`` is linear in the nine numbers of R^T,
in R^T t, the targets o and the rail's way x. Small random sets of poses are solved, and the one that half of the
readings (the middle one of all errors) agree with best is kept and solved again with those that agree (least median of
squares, Rousseeuw 1984, doi:10.1080/01621459.1984.10477105): a target mislabelled, a beam dropped or a joint turned by
90 degrees then stands out instead of turning the frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.absolute.chain import Nominal
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.reduced import Frame
from doe.absolute.turns import nearest_rotation
from robots import InputError, Robot
from robots.arrays import Array, Bools, Indices
from robots.kinematics import forward_kinematics

TRIALS = 200
# So many readings of a session are tried; all that there are settle the frame.
MOST = 2000
# A described arm is off by some millimetres; readings that are off by this much more than the middle one are wrong.
FAR, LEAST_m = 6.0, 0.005


@dataclass(frozen=True)
class Start:
    """Where an estimate sets out from.

    ``frames`` by session, ``targets`` (t, 3) m, ``way`` (3,) of the rail a metre, ``error`` (n,) m of readings, which
    ones (n,) ``agree``; ``rail``: ends of its length that was used, m.
    """

    frames: tuple[Frame, ...]
    targets: Array
    way: Array
    error: Array
    agree: Bools
    rail: tuple[float, float] = (0.0, 0.0)

    @property
    def nominal(self) -> Nominal:
        """What derivatives refer to."""
        return Nominal(self.targets, self.rail)


def started(robot: Robot, data: AbsoluteReadings, seed: int = 0) -> Start:
    """Frames and targets that most readings agree with.

    Raises
    ------
    InputError
        A session with too few readings, or poses that leave its frame open.
    """
    at, rng = forward_kinematics(robot, data.q), np.random.default_rng(seed)
    T, has_rail = len(data.target.names), data.has_rail
    frames: list[Frame] = []
    targets, weight, ways = np.zeros((T, 3)), np.zeros(T), []
    for s, name in enumerate(data.session.names):
        mine = np.flatnonzero(data.session.number == s)
        some = mine if len(mine) <= MOST else np.sort(rng.choice(mine, MOST, replace=False))
        x, best = _session(at.p_flange, at.R_flange, data, some, has_rail, rng)
        if x is None:
            raise InputError(
                f"session {name}: {len(mine)} readings at poses that leave the tracker's frame open",
                allowed=f"{_needed(T, has_rail)} readings or more whose targets do not lie on a line or in a plane",
                remedy="add readings at other poses, or join sessions in which tracker and robot stayed in place; of "
                "positions read at the controller: stiffarm robots check",
            )
        R = nearest_rotation(x[:9].reshape(3, 3)).T
        for t in np.unique(data.target.number[some[best]]):
            count = int((data.target.number[some[best]] == t).sum())
            targets[t] += count * x[12 + 3 * t : 15 + 3 * t]
            weight[t] += count
        ways.append(x[12 + 3 * T :] if has_rail else np.zeros(3))
        frames.append(Frame(R, np.zeros(3)))
    targets /= np.maximum(weight, 1.0)[:, None]
    way = np.mean(ways, axis=0)
    P = at.p_flange + np.einsum("nij,nj->ni", at.R_flange, targets[data.target.number]) + data.rail[:, None] * way
    return _settled(data, frames, targets, way, P)


def _settled(data: AbsoluteReadings, frames: list[Frame], targets: Array, way: Array, P: Array) -> Start:
    """The frames once more by rotations alone, from the readings that agree."""
    error, out = np.zeros(len(data)), []
    agree = np.ones(len(data), dtype=np.bool_)
    for s, frame in enumerate(frames):
        mine = np.flatnonzero(data.session.number == s)
        y, R = data.position[mine], frame.R
        t = np.median(y - P[mine] @ R.T, axis=0)
        for _ in range(10):
            off = np.linalg.norm(y - P[mine] @ R.T - t, axis=1)
            good = off <= max(FAR * float(np.median(off)), LEAST_m)
            a, b = P[mine][good].mean(axis=0), y[good].mean(axis=0)
            R = nearest_rotation((y[good] - b).T @ (P[mine][good] - a))
            t = b - R @ a
        error[mine] = np.linalg.norm(y - P[mine] @ R.T - t, axis=1)
        agree[mine] = error[mine] <= max(FAR * float(np.median(error[mine])), LEAST_m)
        out.append(Frame(R, t))
    rail = (float(data.rail.min()), float(data.rail.max()))
    return Start(tuple(out), targets, way, error, agree, rail)


def _needed(targets: int, has_rail: bool) -> int:
    """Readings that determine a session's numbers."""
    return -(-(12 + 3 * targets + 3 * has_rail) // 3)


def _session(
    p: Array, R: Array, data: AbsoluteReadings, mine: Indices, has_rail: bool, rng: np.random.Generator
) -> tuple[Array | None, Indices]:
    """Numbers (12 + 3 t + 3) of one session and which of its readings agree with them; None where they stay open."""
    T = len(data.target.names)
    A = np.zeros((len(mine), 3, 12 + 3 * T + 3 * has_rail))
    for i in range(3):
        A[:, i, 3 * i : 3 * i + 3] = data.position[mine]
        A[:, i, 9 + i] = -1.0
        if has_rail:
            A[:, i, 12 + 3 * T + i] = -data.rail[mine]
    for t in range(T):
        A[:, :, 12 + 3 * t : 15 + 3 * t] = -R[mine] * (data.target.number[mine] == t)[:, None, None]
    b = p[mine]
    used = np.abs(A).reshape(-1, A.shape[2]).max(axis=0) > 0.0
    size = _needed(int(used[12 : 12 + 3 * T].sum()) // 3, has_rail) + 2
    if len(mine) < size:
        return None, np.arange(0)
    least, kept = np.inf, np.arange(len(mine))
    for trial in range(TRIALS + 1):
        rows = rng.choice(len(mine), min(size, len(mine)), replace=False) if trial else np.arange(len(mine))
        x = _solved(A[rows], b[rows], used)
        error = np.linalg.norm(b - A @ x, axis=1)
        middle = float(np.median(error))
        if middle < least:
            least, kept = middle, np.flatnonzero(error <= max(3.0 * middle, 1e-9))
    for _ in range(3):
        x = _solved(A[kept], b[kept], used)
        error = np.linalg.norm(b - A @ x, axis=1)
        kept = np.flatnonzero(error <= max(FAR * float(np.median(error)), 1e-9))
    s = np.linalg.svd(x[:9].reshape(3, 3), compute_uv=False)
    return (x, kept) if s[-1] > 0.2 and s[0] < 5.0 else (None, kept)


def _solved(A: Array, b: Array, used: Bools) -> Array:
    out = np.zeros(A.shape[2])
    out[used] = np.linalg.lstsq(A[:, :, used].reshape(-1, int(used.sum())), b.reshape(-1), rcond=1e-10)[0]
    return out
