"""Compares a model's kinematics with positions read at the controller, and names the fewest slips that explain them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from robots.pendant.explanations import Explanation, PendantReadings
from robots.pendant.orientations import Turned, orientations, orientations_explained
from robots.pendant.slips import Frame, Slip, fitted, slips
from robots.robot import Robot

# What a controller and a data sheet differ by without anything being wrong: rounded angles, m at arm's length.
TOLERANCE_m = 1e-3
# Slips that are looked for together; more at once hardly ever happen, and anything would be explained by them.
MOST_SLIPS = 3
# Of the pairs, those that lead on to three.
LEADERS = 12
FEWEST_POSES = 3
# Where no slip explains all poses, and as large a share agrees as it stands, the others were read wrong.
MOST_AGREE = 0.7
# A joint that moves less over the poses says nothing of its sign, rad.
STILL_rad = float(np.radians(0.5))
# What x_mm, y_mm, z_mm may hold instead: mm in one of it; and how far spans may be off for it to be noticed.
UNITS_mm = {"metres": 1000.0, "inches": 25.4}
UNIT_BAND = 2.5
_FRAMES: tuple[tuple[Frame, ...], ...] = ((), ("base",), ("tool",), ("base", "tool"), ("turned-base",))


@dataclass(frozen=True, eq=False)
class PendantCheck:
    """``left`` (n, 3) m: readings less model as they stand, in the base frame; ``explanations``: the fewest slips.

    ``agrees``: no slip is needed. ``best``: the closest where none explains the readings. ``still``: joints that
    hardly move over the poses. ``orientation``: how orientations compare with the first explanation (or the best),
    None where none were read. ``misread``: the few poses that alone disagree where no slip explains them.
    """

    readings: PendantReadings
    tolerance: float
    left: Array
    explanations: tuple[Explanation, ...]
    best: Explanation
    still: tuple[str, ...]
    orientation: Turned | None
    misread: tuple[str, ...] = ()

    @property
    def distance(self) -> Array:
        """Distances (n,) m between model and readings as they stand."""
        return np.asarray(np.linalg.norm(self.left, axis=1))

    @property
    def agrees(self) -> bool:
        """Whether positions and orientations agree as they stand."""
        turned = self.orientation
        right = turned is None or (turned.disagreement == 0 and turned.convention is None)
        return bool(self.explanations) and self.explanations[0].things == 0 and right


def check_pendant(robot: Robot, readings: PendantReadings, tolerance: float = TOLERANCE_m) -> PendantCheck:
    """Compare the model with positions read at the controller.

    Where the model file knows the controller's robot frame, positions are taken in that, and in the model's base
    frame too; else in the base frame.

    Raises
    ------
    InputError
        Fewer than three poses, all of them the same, or positions in metres or inches.
    """
    n = len(readings.q)
    if n < FEWEST_POSES or np.ptp(readings.q, axis=0).max() < STILL_rad:
        raise InputError(
            "pendant table: poses",
            code="R007",
            value=n if n < FEWEST_POSES else "all the same",
            allowed=f"{FEWEST_POSES} or more that differ; ten that move every joint tell most",
            remedy="drive to more poses and note angles and position",
        )
    _refuse_other_units(robot, readings)
    bases = _bases(robot)
    places = [(known, _seen(T, readings.position)) for known, T in bases]
    found = _search(robot, readings.q, places, tolerance)
    explained = [e for e in found if e.fit.worst <= tolerance]
    orientation = None
    if readings.rotation is not None and explained:
        both = orientations_explained(robot, readings, readings.rotation, explained, dict(bases), tolerance)
        explained, orientation = [e for e, _ in both], both[0][1]
    best = explained[0] if explained else min(found, key=lambda e: e.fit.worst)
    misread = () if explained else _misread(robot, readings, places[0][1], tolerance)
    if readings.rotation is not None and orientation is None:
        orientation = orientations(robot, readings.rotation, best, dict(bases))
    # As the model stands: in the frame that the best explanation is in, where that needs nothing else.
    at = dict(places)[best.base_known] if best.things == 0 else places[0][1]
    first = fitted(robot, readings.q, at, (), ())
    spread = np.ptp(readings.q, axis=0)
    still = tuple(name for name, s in zip(robot.joint_names, spread, strict=True) if s < STILL_rad)
    return PendantCheck(readings, tolerance, first.left, tuple(explained), best, still, orientation, misread)


def _misread(robot: Robot, readings: PendantReadings, position: Array, tolerance: float) -> tuple[str, ...]:
    """Labels of the poses that disagree where most others agree as the model stands."""
    off = np.linalg.norm(fitted(robot, readings.q, position, (), ()).left, axis=1) > tolerance
    if (~off).sum() < max(FEWEST_POSES, MOST_AGREE * len(off)):
        return ()
    return tuple(label for label, wrong in zip(readings.labels, off.tolist(), strict=True) if wrong)


def _refuse_other_units(robot: Robot, readings: PendantReadings) -> None:
    """Positions that vary a thousandth, or a twenty-fifth, of what the tool moves by are metres, or inches."""
    there = fitted(robot, readings.q, np.zeros((len(readings.q), 3)), (), ()).left
    moved, read = (float(np.linalg.norm(np.ptp(p, axis=0))) for p in (there, readings.position))
    if moved < 0.5 * float(np.linalg.norm(there, axis=1).max()):
        return
    for unit, size in UNITS_mm.items():
        if 1.0 / UNIT_BAND < read * size / moved < UNIT_BAND:
            raise InputError(
                "pendant table: columns x_mm, y_mm, z_mm",
                code="R007",
                value=f"positions that span {1e3 * read:.3g} mm, where the model's tool spans {1e3 * moved:.4g} mm",
                allowed="mm",
                remedy=f"multiply them by {size:g}: they look like {unit}",
            )


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
