"""Compares a model's kinematics with positions read at the controller, and names the fewest slips that explain them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.spatial.transform import Rotation

from robots.arrays import Array
from robots.controller import shown_tool
from robots.errors import InputError
from robots.kinematics import forward_kinematics
from robots.pendant.slips import Fitted, Frame, Slip, fitted, slips
from robots.robot import Robot

# What a controller and a data sheet differ by without anything being wrong: rounded angles, m at arm's length.
TOLERANCE_m = 1e-3
# Slips that are looked for together; more at once hardly ever happen, and anything would be explained by them.
MOST_SLIPS = 3
# Of the pairs, those that lead on to three.
LEADERS = 12
FEWEST_POSES = 3
# A joint that moves less over the poses says nothing of its sign, rad.
STILL_rad = float(np.radians(0.5))
# Orientations agree up to this, rad; controllers show hundredths of a degree.
SAME_TURN_rad = float(np.radians(0.1))
_FRAMES: tuple[tuple[Frame, ...], ...] = ((), ("base",), ("tool",), ("base", "tool"), ("turned-base",))


@dataclass(frozen=True, eq=False)
class PendantReadings:
    """Tool positions read at the controller.

    ``q`` (n, dof) rad: coordinates of the model, as the table's angles make them; ``position`` (n, 3) m and
    ``rotation`` (n, 3, 3) or None: the tool frame in the controller's robot frame; ``labels`` (n,).
    """

    q: Array
    position: Array
    rotation: Array | None
    labels: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Explanation:
    """Slips, and frames that are elsewhere, which explain the positions; ``base_known``: in the controller's frame."""

    chosen: tuple[Slip, ...]
    frames: tuple[Frame, ...]
    fit: Fitted
    base_known: bool

    @property
    def things(self) -> int:
        """How many things are wrong."""
        return len(self.chosen) + len(self.frames)

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of slips and frames."""
        return (*(slip.code for slip in self.chosen), *self.frames)


@dataclass(frozen=True, eq=False)
class PendantCheck:
    """``left`` (n, 3) m: readings less model as they stand, in the base frame; ``explanations``: the fewest slips.

    ``agrees``: no slip is needed. ``best``: the closest where none explains the readings. ``still``: joints that
    hardly move over the poses. ``turned`` (n,) rad between orientations with the first explanation (or the best),
    None where none were read; ``tool_turn``: a constant turn (3, 3) of the tool that explains them all.
    """

    readings: PendantReadings
    tolerance: float
    left: Array
    explanations: tuple[Explanation, ...]
    best: Explanation
    still: tuple[str, ...]
    turned: Array | None
    tool_turn: Array | None

    @property
    def distance(self) -> Array:
        """Distances (n,) m between model and readings as they stand."""
        return np.asarray(np.linalg.norm(self.left, axis=1))

    @property
    def agrees(self) -> bool:
        """Whether positions and orientations agree as they stand."""
        turned = 0.0 if self.turned is None else float(self.turned.max())
        return bool(self.explanations) and self.explanations[0].things == 0 and turned <= SAME_TURN_rad


def check_pendant(robot: Robot, readings: PendantReadings, tolerance: float = TOLERANCE_m) -> PendantCheck:
    """Compare the model with positions read at the controller.

    Where the model file knows the controller's robot frame, positions are taken in that, and in the model's base
    frame too; else in the base frame.

    Raises
    ------
    InputError
        Fewer than three poses, or all of them the same.
    """
    n = len(readings.q)
    if n < FEWEST_POSES or np.ptp(readings.q, axis=0).max() < STILL_rad:
        raise InputError(
            "pendant table: poses", value=n if n < FEWEST_POSES else "all the same",
            allowed=f"{FEWEST_POSES} or more that differ; ten that move every joint tell most",
            remedy="drive to more poses and note angles and position",
        )  # fmt: skip
    bases = _bases(robot)
    places = [(known, _seen(T, readings.position)) for known, T in bases]
    found = _search(robot, readings.q, places, tolerance)
    explained = [e for e in found if e.fit.worst <= tolerance]
    if readings.rotation is not None:
        # Flipping the wrist and turning it half way round lead to the same place, not to the same orientation.
        off = {e: _not_turned(_orientations(robot, readings, e, dict(bases))) for e in explained}
        explained = [e for e in explained if off[e] == min(off.values())]
    best = explained[0] if explained else min(found, key=lambda e: e.fit.worst)
    # As the model stands: in the frame that the best explanation is in, where that needs nothing else.
    at = dict(places)[best.base_known] if best.things == 0 else places[0][1]
    first = fitted(robot, readings.q, at, (), ())
    turned, tool_turn = _orientations(robot, readings, best, dict(bases))
    spread = np.ptp(readings.q, axis=0)
    still = tuple(name for name, s in zip(robot.joint_names, spread, strict=True) if s < STILL_rad)
    return PendantCheck(readings, tolerance, first.left, tuple(explained), best, still, turned, tool_turn)


def _bases(robot: Robot) -> list[tuple[bool, Array]]:
    """The controller's robot frame in the base frame, where it is known and another; and the base frame itself."""
    T = None if robot.controller is None else robot.controller.T_base
    other = [] if T is None or np.allclose(T, np.eye(4), atol=1e-9) else [(True, T)]
    return [*other, (not other, np.eye(4))]


def _seen(T_base: Array, position: Array) -> Array:
    """Positions (n, 3) of the controller's frame in the base frame."""
    return np.asarray(position @ T_base[:3, :3].T + T_base[:3, 3])


def _search(robot: Robot, q: Array, places: list[tuple[bool, Array]], tolerance: float) -> list[Explanation]:
    """Explanations with the fewest slips that reach the tolerance, best first; without any, all of the last round."""
    single = slips(robot)

    def tried(chosen: Iterable[tuple[tuple[Slip, ...], tuple[Frame, ...]]]) -> Iterator[Explanation]:
        for slips_, frames in chosen:
            if _determined(len(q), slips_, frames):
                for known, position in places:
                    yield Explanation(slips_, frames, fitted(robot, q, position, slips_, frames), known)

    rounds: list[list[Explanation]] = []
    leaders: list[tuple[Slip, ...]] = []
    for things in range(MOST_SLIPS + 1):
        found = list(tried(_combinations(single, leaders, things)))
        rounds.append(found)
        good = [e for e in found if e.fit.worst <= tolerance]
        # The model's own frame instead of the controller's is no slip of its own, but comes second.
        if good:
            plain = {e.chosen for e in good if e.frames == ("base",)}
            good = [e for e in good if not (e.frames == ("turned-base",) and e.chosen in plain)]
            return sorted(good, key=lambda e: (not e.base_known, _rank(e), e.fit.worst))
        ranked = sorted((e for e in found if len(e.chosen) == things), key=lambda e: e.fit.worst)
        if things == 2:
            leaders = list(dict.fromkeys(e.chosen for e in ranked))[:LEADERS]
    return [min(each, key=lambda e: e.fit.worst) for each in rounds if each]


def _rank(e: Explanation) -> int:
    """Slips of one joint come before those that move a whole frame, lengths last: there are most of them."""
    slips_ = sum({"angles": 0, "offset": 1, "length": 4}[slip.kind] for slip in e.chosen)
    return slips_ + sum(3 if frame == "turned-base" else 2 for frame in e.frames)


def _not_turned(orientations: tuple[Array | None, Array | None]) -> int:
    """0: orientations agree, 1: but for a constant turn of the tool, 2: they do not."""
    turned, tool_turn = orientations
    if turned is None or turned.max() <= SAME_TURN_rad:
        return 0
    return 1 if tool_turn is not None else 2


def _determined(n: int, chosen: tuple[Slip, ...], frames: tuple[Frame, ...]) -> bool:
    """Whether there are more numbers read than numbers found."""
    unknown = sum(slip.kind != "angles" for slip in chosen) + sum(6 if f == "turned-base" else 3 for f in frames)
    return 3 * n > unknown + 2 * (len(chosen) + len(frames))


def _combinations(
    single: tuple[Slip, ...], leaders: list[tuple[Slip, ...]], things: int
) -> Iterator[tuple[tuple[Slip, ...], tuple[Frame, ...]]]:
    """Slips and frames, so many things in all."""
    # Pairs of angles that are read otherwise, or one of them with an offset or a length; others are not looked for.
    sets: dict[int, list[tuple[Slip, ...]]] = {0: [()], 1: [(slip,) for slip in single]}
    if things >= 2:
        plain = [slip for slip in single if slip.kind == "angles"]
        sized = [slip for slip in single if slip.kind == "offset"]
        sets[2] = [*combinations(plain, 2), *((a, b) for a, b in product(plain, sized))]
    if things >= 3:
        plain = [slip for slip in single if slip.kind != "length"]
        sets[3] = [(*pair, slip) for pair in leaders for slip in plain if slip not in pair]
        sets[2] = leaders
    for frames in _FRAMES:
        for chosen in sets.get(things - len(frames), []):
            if "turned-base" not in frames or not any(slip.kind == "length" for slip in chosen):
                yield chosen, frames


def _orientations(
    robot: Robot, readings: PendantReadings, best: Explanation, bases: dict[bool, Array]
) -> tuple[Array | None, Array | None]:
    """Angles (n,) rad between orientations, and a constant turn of the tool that makes them agree, if one does."""
    if readings.rotation is None:
        return None, None
    turn = best.fit.shift.get("turned-base")
    R_turn = np.eye(3) if turn is None else _rotation(turn[:3])
    flange = R_turn @ forward_kinematics(robot, best.fit.q).R_flange
    tool = np.swapaxes(flange, 1, 2) @ (bases[best.base_known][:3, :3] @ readings.rotation)
    off = shown_tool(robot)[:3, :3].T @ tool
    turned = _angle(off)
    if turned.max() <= SAME_TURN_rad:
        return turned, None
    U, _, Vt = np.linalg.svd(tool.sum(axis=0))
    mean = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return turned, mean if _angle(mean.T @ tool).max() <= SAME_TURN_rad else None


def _angle(R: Array) -> Array:
    """Angles (n,) rad of rotations (n, 3, 3), exact near 0 too."""
    w = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    return np.asarray(np.arctan2(np.linalg.norm(w, axis=1), np.trace(R, axis1=1, axis2=2) - 1.0))


def _rotation(vector: Array) -> Array:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())
