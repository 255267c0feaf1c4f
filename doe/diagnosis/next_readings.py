"""What to measure next: set-ups that tell the surviving candidates apart, as a measurement sheet to fill in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from doe.diagnosis.candidates import stands
from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.discrimination import choose, divergence, joint, right_names
from doe.diagnosis.hypotheses import NONE, UNKNOWN
from doe.diagnosis.rivals import Question, family_of, predictions, question_of, with_candidates
from doe.diagnosis.setting import Setting
from doe.planning.pose_designs import Zone, pose_design
from doe.planning.protocol import Protocol, new_labels, table_to_fill
from doe.tables.measurements import Measurements
from fem.effects.base import PlacedEffect
from fem.statics.loads import LoadedPoses
from robots import InputError
from robots.arrays import Array, Bools
from robots.constants import STANDARD_GRAVITY

DOWN = ((0.0, 0.0, -1.0),)
# Loads are taken from the readings so far, at most so many of them.
MOST_LOADS = 4
# Candidates of a proposal: poses that fill the ranges, in whole degrees, as a sheet is set by hand.
CANDIDATES = 200
MOST_POSES = 30
# Expected log evidence from which on one rival is as good as ruled out (20 to 1).
SETTLED = float(np.log(20.0))
# Pairs told about.
TOLD = 6


@dataclass(frozen=True)
class Rival:
    """One hypothesis that is still possible.

    ``probability``: its weight among the rivals; ``hidden``: the present readings cannot see it; ``against_none``:
    expected log evidence against "nothing missing" by the new readings, if it is true; ``right_before`` and
    ``right_after``: probability that its family comes out on top if it is true.
    """

    code: str
    probability: float
    hidden: bool
    against_none: float
    right_before: float
    right_after: float


@dataclass(frozen=True)
class NextReadings:
    """Set-ups to measure next, in the order of their choice.

    ``q`` (n, dof) rad; ``direction`` (n, 3) of the loads, base axes; ``protocol``: what is done in each; ``labels``
    (n,) of the set-ups; ``first_step``: number of the first new reading. ``rivals``: most probable first.
    ``information`` of the name gained (nat, lower estimate) of ``entropy`` still open;
    ``right_before``, ``right_after``: probability that the right family comes out on top.
    """

    q: Array
    direction: Array
    protocol: Protocol
    labels: tuple[str, ...]
    first_step: int
    rivals: tuple[Rival, ...]
    information: float
    entropy: float
    right_before: float
    right_after: float
    words: tuple[str, ...]

    @property
    def sheet(self) -> Measurements:
        """The readings to take, nothing read yet; steps go on after those of the first table."""
        return table_to_fill(
            "readings to take next", self.q, self.direction, self.labels, self.protocol, self.first_step
        )


def propose(
    s: Setting,
    d: Diagnosis,
    *,
    poses: int = 3,
    loads: Sequence[float] | None = None,
    directions: Sequence[Sequence[float]] = DOWN,
    components: Sequence[int] | None = None,
    unloading: bool | None = None,
    repeats: int = 3,
    zone: Zone = Zone(floor=0.0),  # noqa: B008 - frozen
    coordinates: tuple[str, ...] | None = None,
    candidates: int = CANDIDATES,
    rng: np.random.Generator,
) -> NextReadings:
    """Choose set-ups that best tell the rivals of a diagnosis apart.

    Parameters
    ----------
    s, d : the setting that was diagnosed and what was found (:func:`doe.diagnosis.diagnose.diagnose`)
    poses : how many set-ups, 1 to 30; each takes one direction with all loads
    loads : N, put on in rising order; default: those of the readings (four at most). None may exceed the payload's
        weight, or the largest load so far if that is more.
    directions : of the load, base axes, any length; default straight down
    components : 0 to 5 to read (dx .. rz); default: those read so far
    unloading : whether to read on the way down too; default: if the history of the readings so far is known. Where
        it is not, it stays unknown with the new readings added.
    repeats : of each cycle
    zone, coordinates : where the arm must not be, and the joint coordinates that vary (default all)
    candidates : poses looked at

    Returns
    -------
    NextReadings
        Its ``sheet``, written with the columns to fill, comes back by joining it to the first table
        (:func:`doe.tables.joined.join`): its labels and steps go on after those. ``rng`` settles the choice.

    Raises
    ------
    InputError
        Number of poses, loads, directions or components out of range; hardly any pose that the robot can take.
    """
    protocol = _protocol(s, loads, directions, components, unloading, repeats)
    if not 1 <= poses <= MOST_POSES:
        raise InputError("poses to measure next", value=poses, allowed=f"1 to {MOST_POSES}")
    q = _poses(s, max(candidates, 4 * poses), zone, coordinates, rng)
    question = question_of(s, d)
    q = q[_standing(question, q)]
    at = protocol.every(s.model, q, protocol.course)
    p = predictions(question, with_candidates(question.setting, at, protocol), d.weight, protocol)
    choice = choose(p, poses)
    expected = _by_code(p.code, p.weight, divergence(*joint(p, choice.chosen.tolist())))
    family = {code: family_of(question.setting, code) for code in question.weight}
    after = right_names(p, choice.chosen.tolist(), family, rng)
    rivals = _rivals(question, expected, family, after)
    before, right = (sum(r.probability * getattr(r, f) for r in rivals) for f in ("right_before", "right_after"))
    pose, way = np.divmod(choice.chosen, len(protocol.directions))
    return NextReadings(
        q[pose], protocol.directions[way], protocol, new_labels(poses, "next ", s.data.poses), len(s.data.free.at) + 1,
        rivals, choice.information, choice.entropy, before, right, _words(rivals, expected, before, right),
    )  # fmt: skip


def _protocol(
    s: Setting, loads: Sequence[float] | None, directions: Sequence[Sequence[float]], components: Sequence[int] | None,
    unloading: bool | None, repeats: int,
) -> Protocol:  # fmt: skip
    """What is done in a new set-up, checked."""
    known = np.unique(np.round(np.linalg.norm(s.data.free.at.wrench[:, :3], axis=1), 1))
    known = known[known > 0.0]
    if loads is None and len(known) == 0:
        raise InputError("loads to measure next", value="none", remedy="name them: the readings so far have no force")
    usual = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), MOST_LOADS)).round().astype(int))]
    up = usual if loads is None else np.unique(np.asarray(loads, dtype=np.float64))
    payload = s.description.payload
    most = max(float(known.max(initial=0.0)), np.inf if payload is None else payload.si * STANDARD_GRAVITY)
    if len(up) == 0 or not np.isfinite(up).all() or up[0] <= 0.0 or up[-1] > most:
        raise InputError(
            "loads to measure next (N)",
            value=[float(x) for x in up],
            allowed=f"above 0{f', at most {most:.0f} (payload, or the largest load so far)' if most < np.inf else ''}",
        )
    read = np.unique(s.data.component if components is None else components).tolist()
    way = np.asarray(directions, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        unit = way / np.linalg.norm(way, axis=-1, keepdims=True)
    way_down = s.history.is_known if unloading is None else unloading
    return Protocol(up, unit, tuple(read), repeats, way_down, _point(s))


def _point(s: Setting) -> tuple[float, float, float] | None:
    """Where most of the readings were taken, if that is not the model's tool point."""
    points, count = np.unique(np.round(s.data.free.at.point, 9), axis=0, return_counts=True)
    most = points[int(np.argmax(count))]
    if np.allclose(most, s.model.robot.T_flange_tool[:3, 3], atol=1e-9):
        return None
    x, y, z = (most - s.model.load_point).tolist()
    return x, y, z


def _poses(s: Setting, n: int, zone: Zone, coordinates: tuple[str, ...] | None, rng: np.random.Generator) -> Array:
    """Candidate poses (N, dof), in whole degrees."""
    robot = s.model.robot
    q = pose_design(robot, n, "sobol", coordinates=coordinates, zone=zone, rng=rng)
    q = np.unique(np.radians(np.round(np.degrees(q))), axis=0)
    return q[robot.reachable(q) & zone.free(robot, q)]


def _standing(question: Question, q: Array) -> Bools:
    """The poses (N,) in which the arm can stand whatever rival, another convention of angles say, is true."""
    s = question.setting
    every = [h.signature for h in question.ranking.hypotheses if h.code in question.weight]
    rivals: list[tuple[PlacedEffect, ...]] = [
        (),
        *((PlacedEffect(c.effect, c.values),) for c in every if c is not None and c.effect.gross),
    ]

    def can(rows: Array) -> bool:
        down = np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (len(rows), 1))
        return all(stands(s, LoadedPoses(rows, down, np.zeros((len(rows), 3))), effects) for effects in rivals)

    return np.full(len(q), True) if can(q) else np.array([can(row[None]) for row in q])


def _by_code(code: tuple[str, ...], weight: Array, kl: Array) -> dict[tuple[str, str], float]:
    """Expected log evidence of a code against another: mean over the first one's shapes, the second one's best."""
    index = {c: np.flatnonzero(np.array(code) == c) for c in dict.fromkeys(code)}
    return {
        (a, b): float(np.average(kl[np.ix_(i, j)].min(axis=1), weights=weight[i]))
        for a, i in index.items()
        for b, j in index.items()
        if a != b
    }


def _rivals(
    q: Question, expected: dict[tuple[str, str], float], family: dict[str, str], after: dict[str, float]
) -> tuple[Rival, ...]:
    mass: dict[str, float] = {}
    for code, weight in q.weight.items():
        mass[family[code]] = mass.get(family[code], 0.0) + weight
    top = max(mass, key=lambda f: mass[f])
    order = sorted(q.weight.items(), key=lambda item: -item[1])
    return tuple(
        Rival(c, w, c in q.hidden, expected.get((c, NONE), 0.0), float(family[c] == top), after[c]) for c, w in order
    )


def _words(
    rivals: tuple[Rival, ...], expected: dict[tuple[str, str], float], before: float, after: float
) -> tuple[str, ...]:
    out = [f"probability of naming the right family: {100 * before:.0f} % now, {100 * after:.0f} % after, as foreseen"]
    hidden = [r for r in rivals if r.hidden]
    if hidden:
        seen = [r.code for r in hidden if r.against_none >= SETTLED]
        names = f": {', '.join(seen)}" if seen else ""
        out.append(f"{len(hidden)} candidates are hidden so far; the new readings would show {len(seen)}{names}")
    # Of what stays hidden there is nothing to tell in pairs.
    told = [r.code for r in rivals if r.code != UNKNOWN and not (r.hidden and r.against_none < SETTLED)]
    for pair in islice(combinations(told, 2), TOLD):
        least = min(expected[pair], expected[pair[::-1]])
        what = "would settle it" if least >= SETTLED else "would not settle it"
        first, second = ("nothing missing" if c == NONE else c for c in pair)
        out.append(f"{first} or {second}: expected log evidence {least:.1f}, which {what}")
    return tuple(out)
