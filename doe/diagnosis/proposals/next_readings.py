"""What to measure next: set-ups that tell the surviving candidates apart, as a measurement sheet to fill in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from doe.diagnosis.candidates import stands
from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.hypotheses import UNKNOWN
from doe.diagnosis.proposals.discrimination import Outcome, Predictions, choose, told, without_idle
from doe.diagnosis.proposals.foresight import WORTH_MEASURING, Rival, called, foresee, tempered
from doe.diagnosis.proposals.rivals import Question, predictions, question_of, with_candidates
from doe.diagnosis.setting import Setting
from doe.planning.pose_designs import pose_design
from doe.planning.protocol import Protocol, new_labels, table_to_fill, usual_directions, usual_loads, usual_point
from doe.planning.zones import Zone
from doe.tables.measurements import Measurements
from fem.effects.base import PlacedEffect
from fem.statics.loads import LoadedPoses
from robots import InputError
from robots.arrays import Array, Bools
from robots.constants import STANDARD_GRAVITY
from robots.progress import Progress

# Candidates of a proposal, each with one direction of the load: poses that fill the ranges, in whole degrees, as a
# sheet is set by hand.
CANDIDATES = 200
MOST_POSES = 30
# Components that any gauge that can be turned reads.
LENGTHS = (0, 1, 2)
# A pose is another one than those read so far if some joint turns by this much, deg.
ANOTHER = 5.0
# A set-up must tell this share of what is open, or it is not worth the while.
WORTH = 0.01
# Where less than this (nat) is open, it counts as if so much were: a name of 99.9 % needs no set-up.
OPEN = 0.5
# Laws of the load show at so many.
FEW_LOADS = 4


@dataclass(frozen=True)
class NextReadings:
    """Set-ups to measure next, in the order of their choice.

    ``q`` (n, dof) rad; ``direction`` (n, 3) of the loads, base axes; ``protocol``: what is done in each; ``labels``
    (n,) of the set-ups; ``first_step``: number of the first new reading. ``rivals``: most probable first.
    ``information`` of the name gained (nat, lower estimate) of ``entropy`` still open; ``before``, ``after``: what the
    verdict is worth by the readings so far and with the new ones, over all rivals; ``expected``: as far as such
    forecasts came true.
    """

    q: Array
    direction: Array
    protocol: Protocol
    labels: tuple[str, ...]
    first_step: int
    rivals: tuple[Rival, ...]
    information: float
    entropy: float
    before: Outcome
    after: Outcome
    expected: Outcome
    words: tuple[str, ...]

    @property
    def is_worth_measuring(self) -> bool:
        """Whether they will settle the right name with a fair chance."""
        return self.expected.right >= WORTH_MEASURING

    @property
    def could_be_worth_measuring(self) -> bool:
        """Whether any set-ups could be: something unknown has no name that readings could settle."""
        named = 1.0 - sum(r.probability for r in self.rivals if r.code == UNKNOWN)
        return tempered(self.before, Outcome(1.0, named, 0.0)).right >= WORTH_MEASURING

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
    still_open: Mapping[str, Sequence[str]] | None = None,
    poses: int = 3,
    loads: Sequence[float] | None = None,
    directions: Sequence[Sequence[float]] | None = None,
    components: Sequence[int] | None = None,
    unloading: bool | None = None,
    repeats: int = 3,
    zone: Zone = Zone(floor=0.0),  # noqa: B008 - frozen
    coordinates: tuple[str, ...] | None = None,
    candidates: int = CANDIDATES,
    rng: np.random.Generator,
    progress: Progress | None = None,
) -> NextReadings:
    """Choose set-ups that best tell the rivals of a diagnosis apart.

    Parameters
    ----------
    s, d : the setting that was diagnosed and what was found (:func:`doe.diagnosis.diagnose.diagnose`)
    still_open : rivals of effects that were named (:func:`doe.diagnosis.proposals.rivals.open_twins`)
    poses : how many set-ups at most, 1 to 30; each takes one direction with all loads
    loads : N, put on in rising order; default: those of the readings (few of many), others where these tell nothing.
        None may exceed the payload's weight, or the largest load so far if that is more.
    directions : of the load, base axes, any length; default those of the readings
    components : 0 to 5 to read (dx .. rz); default: those read so far; X, Y and Z where these alone tell nothing
    unloading : whether to read on the way down too; default: if the history of the readings so far is known. Where
        it is not, it stays unknown with the new readings added.
    repeats : of each cycle
    zone, coordinates : where the arm and a load that hangs from it must not be, and the joint coordinates that vary
        (default all)
    candidates : set-ups looked at, some sixty poses at least

    Returns
    -------
    NextReadings
        Its ``sheet``, written with the columns to fill, comes back by joining it to the first table
        (:func:`doe.tables.joined.join`): its labels and steps go on after those. ``rng`` settles the choice. Set-ups
        that would tell next to nothing beside the others are left out.

    Raises
    ------
    InputError
        Number of poses, loads, directions or components out of range; hardly any pose that the robot can take; no
        set-up that would tell the rivals apart.
    """
    usual = _protocol(s, loads, directions, components, unloading, repeats)
    if not 1 <= poses <= MOST_POSES:
        raise InputError("poses to measure next", code="C005", value=poses, allowed=f"1 to {MOST_POSES}")
    count = max(candidates // len(usual.directions), min(candidates, 60), 4 * poses)
    q = possible_poses(s, count, usual, zone, coordinates, rng)
    question = question_of(s, d, still_open)
    q = q[_standing(question, q)]
    remark: tuple[str, ...] = ()
    for protocol, remark in ways_to_read(usual, loads is None, components is None):  # noqa: B007 - told below
        p, chosen, entropy = _chosen(question, q, protocol, d.weight, poses, progress)
        if chosen:
            break
    else:
        raise InputError(
            f"set-ups that would tell {_one_of(question)}",
            code="C005",
            value=f"none of {len(p)} tried",
            remedy="read other components, load in other directions, or look at the set-up itself",
        )
    pose, way = np.divmod(np.array(chosen, dtype=np.intp), len(protocol.directions))
    foreseen = foresee(question, p, chosen, rng)
    return NextReadings(
        q[pose],
        protocol.directions[way],
        protocol,
        new_labels(len(chosen), "next ", s.data.poses),
        len(s.data.free.at) + 1,
        foreseen.rivals,
        told(doubted(p), chosen),
        entropy,
        foreseen.before,
        foreseen.after,
        foreseen.expected,
        (*foreseen.words, *remark),
    )


def ways_to_read(protocol: Protocol, loads: bool, components: bool) -> Iterator[tuple[Protocol, tuple[str, ...]]]:
    """What may be done in a set-up, with a remark: as so far; else X, Y and Z read; else other loads too.

    ``loads``, ``components``: whether these may be others than asked for.
    """
    yield protocol, ()
    if components and set(protocol.components) < set(LENGTHS):
        protocol = replace(protocol, components=LENGTHS)
        yield protocol, ("along the axes read so far no set-up would tell them apart: X, Y and Z are asked for",)
    if loads:
        least, most = protocol.forces[0], protocol.forces[-1]
        others = np.unique([float(f"{v:.3g}") for v in (0.5 * least, least, 0.5 * (least + most), most)])
        yield (
            replace(protocol, forces=others),
            ("at the loads and along the axes so far no set-up would tell them apart: others are asked for",),
        )


def ways_to_measure(s: Setting) -> dict[str, dict[str, Any]]:
    """What :func:`propose` may be asked for, by what is other than so far: nothing; more loads; other directions."""
    wrench = s.data.free.at.wrench[:, :3]
    known, ways = usual_loads(wrench), {"": dict[str, Any]()}
    if 0 < len(known) < FEW_LOADS:
        ways["at more loads than so far"] = {"loads": np.linspace(0.25, 1.0, FEW_LOADS) * known[-1]}
    if len(usual_directions(wrench)) < len(LENGTHS):
        ways["loaded along X, Y and Z"] = {"directions": np.diag([1.0, 1.0, -1.0]), "components": LENGTHS}
    return ways


def _chosen(
    question: Question, q: Array, protocol: Protocol, weight: Array, poses: int, progress: Progress | None
) -> tuple[Predictions, list[int], float]:
    """What rivals predict in poses q (N, dof), the best set-ups of which each tells something, and what is open."""
    at = protocol.every(question.setting.model, q, protocol.course)
    p = predictions(question, with_candidates(question.setting, at, protocol), weight, protocol)
    choice = choose(doubted(p), poses, progress)
    return p, without_idle(doubted(p), choice.chosen.tolist(), WORTH * max(choice.entropy, OPEN)), choice.entropy


def doubted(p: Predictions) -> Predictions:
    """As if something unknown were no more likely than all else together: no set-up would tell more beside it."""
    unknown = np.array([code == UNKNOWN for code in p.code])
    share = float(p.weight[unknown].sum())
    if share <= 0.5 or share >= 1.0:
        return p
    return replace(p, weight=np.where(unknown, 0.5 * p.weight / share, 0.5 * p.weight / (1.0 - share)))


def at_random(n: NextReadings, s: Setting, zone: Zone, rng: np.random.Generator, poses: int = 3) -> NextReadings:
    """Set-ups like those proposed, measured in the same way, but of possible poses drawn at random, for comparison.

    ``s``: the setting of the readings that they go on after.
    """
    q = possible_poses(s, 64, n.protocol, zone, None, rng)
    chosen = rng.choice(len(q), poses, replace=False)
    way = rng.integers(len(n.protocol.directions), size=poses)
    labels = new_labels(poses, "next ", s.data.poses)
    return replace(
        n, q=q[chosen], direction=n.protocol.directions[way], labels=labels, first_step=len(s.data.free.at) + 1
    )


def _one_of(q: Question) -> str:
    order = sorted(q.weight, key=lambda code: -q.weight[code])
    return " from ".join(called(code) for code in order[:2])


def _protocol(
    s: Setting,
    loads: Sequence[float] | None,
    directions: Sequence[Sequence[float]] | None,
    components: Sequence[int] | None,
    unloading: bool | None,
    repeats: int,
) -> Protocol:
    """What is done in a new set-up, checked."""
    so_far = s.data.free.at
    known = usual_loads(so_far.wrench[:, :3])
    if loads is None and len(known) == 0:
        raise InputError(
            "loads to measure next", code="C006", value="none", remedy="name them: the readings so far have no force"
        )
    up = known if loads is None else np.unique(np.asarray(loads, dtype=np.float64))
    payload = s.description.payload
    most = max(float(known.max(initial=0.0)), np.inf if payload is None else payload.si * STANDARD_GRAVITY)
    if len(up) == 0 or not np.isfinite(up).all() or up[0] <= 0.0 or up[-1] > most:
        raise InputError(
            "loads to measure next (N)",
            code="C006",
            value=[float(x) for x in up],
            allowed=f"above 0{f', at most {most:.0f} (payload, or the largest load so far)' if most < np.inf else ''}",
        )
    read = np.unique(s.data.component if components is None else components).tolist()
    way = usual_directions(so_far.wrench[:, :3]) if directions is None else np.asarray(directions, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        unit = way / np.linalg.norm(way, axis=-1, keepdims=True)
    way_down = s.history.is_known if unloading is None else unloading
    point = usual_point(so_far.point - s.model.load_point, s.model.robot.T_flange_tool[:3, 3] - s.model.load_point)
    return Protocol(up, unit, tuple(read), repeats, way_down, point)


def possible_poses(
    s: Setting, n: int, protocol: Protocol, zone: Zone, coordinates: tuple[str, ...] | None, rng: np.random.Generator
) -> Array:
    """Some n poses (N, dof) rad, in whole degrees, that the arm can take and that have not been read yet.

    Where a load hangs in any of the protocol's set-ups it has room below it in all of them.

    Raises
    ------
    InputError
        Hardly any such pose.
    """
    robot = s.model.robot
    q = pose_design(robot, 2 * n, "sobol", coordinates=coordinates, zone=zone, rng=rng)
    q = np.radians(np.round(np.degrees(q)))
    q = q[np.sort(np.unique(q, axis=0, return_index=True)[1])]
    fits = robot.reachable(q)
    fits[fits] = zone.free(robot, q[fits])
    if protocol.hangs:
        fits[fits] = zone.hangs_free(robot, q[fits], protocol.at(s.model))
    q = q[fits]
    read = np.unique(s.data.free.at.q, axis=0)
    q = q[np.abs(q[:, None] - read[None]).max(axis=2).min(axis=1, initial=np.inf) >= np.radians(ANOTHER)]
    if len(q) < n // 4:
        raise InputError(
            f"poses of {robot.name} that are new, possible and leave room for a load: {len(q)}",
            code="C005",
            allowed=f"{n // 4} or more",
            remedy="lower the floor, move the boxes, or give less clearance",
        )
    return np.asarray(q[:n])


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
