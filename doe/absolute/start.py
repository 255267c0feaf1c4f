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
from robots.kinematics import forward_kinematics, stretched_length

TRIALS = 200
# So many readings of a session are tried; all that there are settle the frame.
MOST = 2000
# A described arm is off by some millimetres; readings that are off by this much more than the middle one are wrong.
FAR, LEAST_m = 6.0, 0.005


# Lengths along three axes that agree to this share but differ from the arm's by that factor are in another unit; single
# ones beyond the last factor are no frame at all.
ALIKE, SCALE, WILD = 1.3, 1.5, 5.0
# Rounds of frame and targets in turn, and how far positions must lie apart in a second direction for that.
IN_TURN, APART_m = 60, 0.02
# Share of the arm's length (in a plane: of the positions' spread) by which a described arm may miss the middle reading.
MISSED = 0.03


@dataclass(frozen=True)
class Start:
    """Where an estimate sets out from.

    ``frames`` by session, ``targets`` (t, 3) m, ``way`` (3,) of the rail a metre, ``error`` (n,) m of readings, which
    ones (n,) ``agree``; ``rail``: ends of its length that was used, m;
    ``time`` of the first and the last reading; ``temperature``: mean, deg C.
    """

    frames: tuple[Frame, ...]
    targets: Array
    way: Array
    error: Array
    agree: Bools
    rail: tuple[float, float] = (0.0, 0.0)
    time: tuple[float, float] = (0.0, 0.0)
    temperature: float = 0.0

    def doubt(self, robot: Robot) -> tuple[str, ...]:
        """A sentence where the described arm is far from its readings; none else."""
        middle = float(np.median(self.error))
        if middle <= MISSED * stretched_length(robot):
            return ()
        return (
            f"the arm as described misses half of its readings by more than {1e3 * middle:.0f} mm: look for a sign, a "
            "zero, a unit or a length that is wrong in the model or the table (stiffarm robots check tells which)",
        )

    @property
    def nominal(self) -> Nominal:
        """What derivatives refer to."""
        return Nominal(self.targets, self.rail, self.time, self.temperature)


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
            raise _no_frame(name, len(mine), _needed(T, has_rail) + 2)
        R = nearest_rotation(x[:9].reshape(3, 3)).T
        for t in np.unique(data.target.number[some[best]]):
            count = int((data.target.number[some[best]] == t).sum())
            targets[t] += count * x[12 + 3 * t : 15 + 3 * t]
            weight[t] += count
        if np.ptp(data.rail[mine]) > 0.0:
            ways.append(x[12 + 3 * T :])
        frames.append(Frame(R, np.zeros(3)))
    targets /= np.maximum(weight, 1.0)[:, None]
    way = np.mean(ways, axis=0) if ways else np.zeros(3)
    P = at.p_flange + np.einsum("nij,nj->ni", at.R_flange, targets[data.target.number]) + data.rail[:, None] * way
    return _settled(data, frames, targets, way, P)


def _no_frame(session: str, readings: int, needed: int) -> InputError:
    """What to raise where a session's frame stays open."""
    if readings < needed:
        return InputError(
            f"readings of session {session}", value=readings, allowed=f"{needed} or more for its frame",
            remedy="add readings, or join sessions in which tracker and robot stayed in place",
        )  # fmt: skip
    return InputError(
        f"session {session}: no frame of the tracker brings its positions and the arm's together",
        allowed="targets that do not all lie on a line, at angles as the model counts them",
        remedy="add readings at other poses; check units, signs and zeros of the angles (stiffarm robots check)",
    )


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
    time = (float(data.time.min()), float(data.time.max())) if len(data.time) else (0.0, 0.0)
    temperature = float(data.temperature.mean()) if len(data.temperature) else 0.0
    return Start(tuple(out), targets, way, error, agree, rail, time, temperature)


def _needed(targets: int, has_rail: bool) -> int:
    """Readings that determine a session's numbers."""
    return -(-(12 + 3 * targets + 3 * has_rail) // 3)


def _session(
    p: Array, R: Array, data: AbsoluteReadings, mine: Indices, has_rail: bool, rng: np.random.Generator
) -> tuple[Array | None, Indices]:
    """Numbers (12 + 3 t + 3) of one session and which of its readings agree with them; None where they stay open."""
    T = len(data.target.names)
    moves = has_rail and bool(np.ptp(data.rail[mine]) > 0.0)
    A = np.zeros((len(mine), 3, 12 + 3 * T + 3 * has_rail))
    for i in range(3):
        A[:, i, 3 * i : 3 * i + 3] = data.position[mine]
        A[:, i, 9 + i] = -1.0
        if moves:
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
    if s[0] < ALIKE * s[-1] and not 1.0 / SCALE < s[0] < SCALE:
        raise InputError(
            "positions of targets",
            value=f"{1.0 / s[0]:.3g} times as far from one another as the arm moves them",
            allowed="mm, as the columns x_mm, y_mm and z_mm say",
            remedy="convert them to mm, or choose the model of the robot that was measured",
        )
    if s[0] < ALIKE * s[-1] and np.linalg.det(x[:9].reshape(3, 3)) < 0.0:
        raise InputError(
            "positions of targets",
            value="the mirror image of where the arm puts them",
            allowed="a frame whose axes are right-handed",
            remedy="give one coordinate the other sign, or swap two that were mistaken for one another",
        )
    if s[-1] > 1.0 / WILD and s[0] < WILD:
        return x, kept
    return (None, kept) if moves else _in_turn(b, R[mine], data, mine)


def _in_turn(p: Array, R: Array, data: AbsoluteReadings, mine: Indices) -> tuple[Array | None, Indices]:
    """Frame and targets one after the other, for positions in a plane, which leave nine free numbers open.

    The frame as a rotation (Kabsch) with the targets as they are, targets and a shift with that frame, and so on.
    """
    T, y, target = len(data.target.names), data.position[mine], data.target.number[mine]
    o, kept = np.zeros((T, 3)), np.arange(len(mine))
    design = np.concatenate([*(R * (target == t)[:, None, None] for t in range(T)),
                             np.broadcast_to(np.eye(3), R.shape)], axis=2)  # fmt: skip
    x, error = np.zeros(12 + 3 * T), np.full(len(mine), np.inf)
    for _ in range(IN_TURN):
        P = p + np.einsum("nij,nj->ni", R, o[target])
        a, b = P[kept].mean(axis=0), y[kept].mean(axis=0)
        Q = nearest_rotation((y[kept] - b).T @ (P[kept] - a))
        inside = (y - b) @ Q + a
        found = np.linalg.lstsq(design[kept].reshape(-1, 3 * T + 3), (inside - p)[kept].reshape(-1), rcond=1e-8)[0]
        o = found[:-3].reshape(T, 3)
        error = np.linalg.norm(inside - p - design @ found, axis=1)
        kept = np.flatnonzero(error <= max(FAR * float(np.median(error)), LEAST_m))
        x[:9], x[12:] = Q.T.reshape(-1), found[:-3]
    spread = np.linalg.svd(y[kept] - y[kept].mean(axis=0), compute_uv=False) / np.sqrt(len(kept))
    good = spread[1] > APART_m and float(np.median(error)) < MISSED * float(np.linalg.norm(spread))
    return (x, kept) if good else (None, kept)


def _solved(A: Array, b: Array, used: Bools) -> Array:
    out = np.zeros(A.shape[2])
    out[used] = np.linalg.lstsq(A[:, :, used].reshape(-1, int(used.sum())), b.reshape(-1), rcond=1e-10)[0]
    return out
