"""Frames and targets to begin with, in closed form, whatever part of the readings is wrong.

With the described arm, ``R^T position - R^T t - R_flange o = p_flange + x way`` is linear in the nine numbers of R^T,
in R^T t, the targets o and the rail's way x. Small random sets of poses are solved, and the one that half of the
readings (the middle one of all errors) agree with best is kept and solved again with those that agree (least median of
squares, Rousseeuw 1984, doi:10.1080/01621459.1984.10477105): a target mislabelled, a beam dropped or a joint turned by
90 degrees then stands out instead of turning the frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

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
# Rounds of a rotation's search and of leaving readings aside, and random sets where most readings spoil it.
SEARCH, ASIDE, FEW_TRIALS = 40, 5, 40
# How far positions must lie apart in a second direction: less where they miss the middle reading by much less.
APART_m, APART, LEAST_APART_m = 0.02, 50.0, 1e-3
# A target is no farther from the flange than so many lengths of the arm.
FARTHEST = 2.0
# Share of the arm's length beyond which that is said.
REACH = 0.5
# Share of the arm's length (of a rotation: of the positions' spread) by which a described arm may miss the middle one.
MISSED = 0.03
# Nine numbers say something of units where they leave less than this share of what targets alone leave.
TELLS = 0.1
# What rotations are looked for from.
ROUND = Rotation.create_group("O").as_matrix()


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

    @property
    def nominal(self) -> Nominal:
        """What derivatives refer to."""
        way = {"way": tuple(self.way.tolist())} if self.way.any() else {}
        return Nominal(self.targets, self.rail, self.time, self.temperature, **way)


def doubt(robot: Robot, distance: Array) -> tuple[str, ...]:
    """A sentence where the described arm, frames and targets fitted, is far (n,) m from its readings; none else."""
    middle = float(np.median(distance))
    if middle <= MISSED * stretched_length(robot):
        return ()
    return (
        f"the arm as described misses half of its readings by more than {1e3 * middle:.0f} mm: look for a sign, a "
        "zero, a unit or a length that is wrong in the model or the table (stiffarm robots check tells which)",
    )


def far_words(robot: Robot, names: Sequence[str], targets: Array) -> Iterator[str]:
    """A sentence for each target (t, 3) m so far from the flange that a unit or a length may be wrong."""
    for name, distance in zip(names, np.linalg.norm(targets, axis=1), strict=True):
        if distance > REACH * stretched_length(robot):
            yield (
                f"target {name or 'on the flange'} is {1e3 * distance:.0f} mm from the flange: if it is not, check the "
                "unit of the positions and the arm's lengths, which few joints that move cannot tell from a target"
            )


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
    far, most = float(np.linalg.norm(targets, axis=1).max(initial=0.0)), FARTHEST * stretched_length(robot)
    if far > most:
        raise InputError(
            "targets: farthest from the flange",
            code="C007",
            value=f"{1e3 * far:.3g} mm",
            allowed=f"{1e3 * most:.3g} mm at most",
            remedy="check that positions are in mm, and that the model is the robot that was measured",
        )
    way = np.mean(ways, axis=0) if ways else np.zeros(3)
    P = at.p_flange + np.einsum("nij,nj->ni", at.R_flange, targets[data.target.number]) + data.rail[:, None] * way
    return _settled(data, frames, targets, way, P)


def _no_frame(session: str, readings: int, needed: int) -> InputError:
    """What to raise where a session's frame stays open."""
    if readings < needed:
        return InputError(
            f"readings of session {session}",
            code="C001",
            value=readings,
            allowed=f"{needed} or more for its frame",
            remedy="add readings, or join sessions in which tracker and robot stayed in place",
        )
    return InputError(
        f"session {session}: no frame of the tracker brings its positions and the arm's together",
        code="C007",
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
    turned, there, fits = _rotated(A, b, used, kept, x, rng)
    if fits:
        return turned, there
    _check_scale(x, A[kept], b[kept], used)
    s = np.linalg.svd(x[:9].reshape(3, 3), compute_uv=False)
    return (turned, there) if s[-1] > 1.0 / WILD and s[0] < WILD else (None, kept)


def _check_scale(x: Array, A: Array, b: Array, used: Bools) -> None:
    """Refuse positions in another unit, or mirrored, where nine numbers x[:9] say so that are not said by targets."""
    alone = used.copy()
    alone[:9] = False
    least, most = (float(np.median(np.linalg.norm(b - A @ y, axis=1))) for y in (x, _solved(A, b, alone)))
    s = np.linalg.svd(x[:9].reshape(3, 3), compute_uv=False)
    if least >= TELLS * most or s[0] >= ALIKE * s[-1]:
        return
    if not 1.0 / SCALE < s[0] < SCALE:
        raise InputError(
            "positions of targets",
            code="C007",
            value=f"{1.0 / s[0]:.3g} times as far from one another as the arm moves them",
            allowed="mm, as the columns x_mm, y_mm and z_mm say",
            remedy="convert them to mm, or choose the model of the robot that was measured",
        )
    if np.linalg.det(x[:9].reshape(3, 3)) < 0.0:
        raise InputError(
            "positions of targets",
            code="C007",
            value="the mirror image of where the arm puts them",
            allowed="a frame whose axes are right-handed",
            remedy="give one coordinate the other sign, or swap two that were mistaken for one another",
        )


def _rotated(
    A: Array, b: Array, used: Bools, kept: Indices, x: Array, rng: np.random.Generator
) -> tuple[Array, Indices, bool]:
    """Numbers with a rotation first, which readings agree, and whether half of them do to a share of their spread.

    From the readings ``kept``, which agree with nine numbers x[:9]; where that does not fit, from random sets.
    """
    y = A[:, 0, :3]
    spread = np.linalg.svd(y - np.median(y, axis=0), compute_uv=False) / np.sqrt(len(y))
    starts = np.concatenate([nearest_rotation(x[:9].reshape(3, 3))[None], ROUND])
    size, best, least = -(-int(used[9:].sum() + 3) // 3) + 2, x, np.inf
    for trial in range(FEW_TRIALS):
        rows = rng.choice(len(y), min(size, len(y)), replace=False) if trial else kept
        for _ in range(1 if trial else ASIDE):
            found = _turned(A[rows], b[rows], used, starts)
            error = np.linalg.norm(b - A @ found, axis=1)
            middle = float(np.median(error))
            if middle < least:
                least, best = middle, found
            rows = np.flatnonzero(error <= max(FAR * middle, LEAST_m))
        if least < MISSED * float(np.linalg.norm(spread)):
            break
    for _ in range(ASIDE):
        error = np.linalg.norm(b - A @ best, axis=1)
        kept = np.flatnonzero(error <= max(FAR * float(np.median(error)), LEAST_m))
        best = _turned(A[kept], b[kept], used, best[:9].reshape(1, 3, 3))
    wide = spread[1] > max(min(APART_m, APART * least), LEAST_APART_m)
    return best, kept, bool(wide and least < MISSED * np.linalg.norm(spread))


def _turned(A: Array, b: Array, used: Bools, starts: Array) -> Array:
    """The numbers of least squares of which the first nine are a rotation (by rows), from rotations (k, 3, 3)."""
    flat, known, free = A.reshape(-1, A.shape[2]), b.reshape(-1), np.flatnonzero(used[9:]) + 9
    U, s, _ = np.linalg.svd(flat[:, free], full_matrices=False)
    U = U[:, s > 1e-10 * s[0]]
    rows = np.column_stack([flat[:, :9], known])
    H: Array = np.asarray(np.linalg.qr(rows - U @ (U.T @ rows), mode="r"))
    M, damping = starts.copy(), np.full(len(starts), 1e-3 * np.sum(H[:, :9] ** 2))
    miss = H[:, 9] - M.reshape(-1, 9) @ H[:, :9].T
    about = np.cross(np.eye(3)[:, None], np.eye(3)[None]).swapaxes(1, 2)
    for _ in range(SEARCH):
        J = (M[:, None] @ about).reshape(len(M), 3, 9) @ H[:, :9].T
        G = J @ J.swapaxes(1, 2) + damping[:, None, None] * np.eye(3)
        w = np.linalg.solve(G, J @ miss[:, :, None])[:, :, 0]
        tried = M @ Rotation.from_rotvec(w).as_matrix()
        left = H[:, 9] - tried.reshape(-1, 9) @ H[:, :9].T
        better = np.sum(left**2, axis=1) < np.sum(miss**2, axis=1)
        M, miss = np.where(better[:, None, None], tried, M), np.where(better[:, None], left, miss)
        damping = damping * np.where(better, 0.1, 10.0)
    x = np.zeros(A.shape[2])
    x[:9] = M[int(np.argmin(np.sum(miss**2, axis=1)))].reshape(-1)
    x[free] = np.linalg.lstsq(flat[:, free], known - flat[:, :9] @ x[:9], rcond=1e-10)[0]
    return x


def _solved(A: Array, b: Array, used: Bools) -> Array:
    out = np.zeros(A.shape[2])
    out[used] = np.linalg.lstsq(A[:, :, used].reshape(-1, int(used.sum())), b.reshape(-1), rcond=1e-10)[0]
    return out
