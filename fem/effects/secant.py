"""Effects that are not linear in the load as compliances: the secant at a stated load.

Stiffness in N/mm has a meaning for a linear arm only. Where a joint has backlash or friction, or stiffens with the
torque, an answer holds for one load: the **secant** there, displacement over force from zero to that load. With

- a law that turns joint j by ``h(tau)``, the joint's spring gets the compliance ``c + h(tau) / tau``, tau being the
  torque of the stated load in that pose (:class:`SecantSpring`);
- any other law that moves the tool by h under the stated wrench w, the arm gets the compliance ``h h^T / (h . w)``: the
  only symmetric one of rank one with ``C w = h``. A law that is linear in the load gets its whole matrix.

So along the stated load the arm with secants moves exactly as the law says; in other directions it is a linear arm
that was made at this load. A law with a memory is taken at its first loading from zero. A law that needs a clock or a
session cannot be carried (:attr:`Secants.left_out`); nor can what belongs to one measurement, its loads and gauges,
which is no part of the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.effects.base import PlacedEffect
from fem.effects.observed import act, observed
from fem.effects.situation import Situation, plain_history
from fem.model import ArmModel
from fem.springs import SpringLaw
from fem.statics.flexibility import deflection
from fem.statics.loads import LoadedPoses
from robots.arrays import Array
from robots.robot import trial_poses

# Where the stated load turns a joint by less than this share of what a force of that size could, the secant is that of
# the largest: it adds nothing along the load, and across it the law's root, where a gap opens, says nothing of use.
LEAST = 1e-6
# What is round-off in displacements of one law at loads twice as large, or across a joint's own direction.
SAME = 1e-9
# Share of its spring's compliance that a joint which sticks is left with.
STUCK = 1e-9
# Poses at which a law is tried, and the force of a trial (N).
TRIED = 8
# Of the work of two vectors that are nearly across one another nothing is left but round-off.
ACROSS = 1e-6


@dataclass(frozen=True, eq=False)
class StatedLoad:
    """The load that secants are taken at: ``force`` (3,) N, base axes; ``point`` (3,) m, flange frame; None: the tool.

    Its size matters, and its sign where a law tells push from pull.
    """

    force: Array
    point: Array | None = None

    @property
    def size(self) -> float:
        """Newtons."""
        return float(np.linalg.norm(self.force))

    def at(self, model: ArmModel, q: Array) -> LoadedPoses:
        """The load put on at poses (n, dof)."""
        point = model.robot.T_flange_tool[:3, 3] if self.point is None else self.point
        wrench = np.concatenate([self.force, np.zeros(3)])
        return LoadedPoses(q, np.tile(wrench, (len(q), 1)), np.tile(point, (len(q), 1)))


@dataclass(frozen=True, eq=False)
class Secants:
    """What an arm's compliance has of its effects: those ``carried`` at the ``load``, and those ``left_out``.

    ``bent``: carried ones that are not linear, so that another load has another compliance. ``further``: carried ones
    that are no spring of one joint, as parts of their own. ``plain``: the arm without.
    """

    load: StatedLoad
    plain: ArmModel
    carried: tuple[PlacedEffect, ...] = ()
    bent: tuple[PlacedEffect, ...] = ()
    left_out: tuple[PlacedEffect, ...] = ()
    further: tuple[SecantPart, ...] = ()


def plain(model: ArmModel) -> ArmModel:
    """The arm without secants."""
    return model if model.secants is None else model.secants.plain


@dataclass(frozen=True, eq=False)
class SecantSpring:
    """A joint's spring with the secant of the laws that turn the joint, ``c(q) + h / tau`` at the stated load.

    ``model``: the arm without secants.
    """

    spring: SpringLaw
    joint: str
    laws: tuple[PlacedEffect, ...]
    model: ArmModel
    load: StatedLoad

    def compliance(self, q: Array) -> Array:
        """See :class:`fem.springs.SpringLaw`."""
        s = _situation(self.model, self.load.at(self.model, q))
        row, tau = s.row(self.joint), s.torque(self.joint)
        size = np.linalg.norm(row, axis=0)
        if (small := np.abs(tau) < LEAST * self.load.size * size).any():
            along = (np.where(tau < 0.0, -1.0, 1.0) * self.load.size / size) * row
            wrench = np.where(small[:, None], along.T, s.at.wrench)
            s = _situation(self.model, replace(s.at, wrench=wrench))
            tau = s.torque(self.joint)
        turn = sum(np.einsum("kn,nk->n", row, act(law, None, s)) for law in self.laws) / size**2
        own = self.spring.compliance(q)
        found = own + turn / tau
        # A joint that sticks gives way by nothing; a part that is there in some poses only would be no part.
        return np.asarray(np.where(np.abs(found) < STUCK * own, STUCK * own, found))


@dataclass(frozen=True, eq=False)
class SecantPart:
    """An effect that is no spring of one joint, as a compliance of its own; ``model``: the arm without secants."""

    law: PlacedEffect
    model: ArmModel
    load: StatedLoad
    is_linear: bool

    @property
    def name(self) -> str:
        """The effect's code."""
        return self.law.effect.code

    def compliance(self, q: Array) -> Array:
        """Compliance (n, 6, 6) at the stated load's point, base axes."""
        at = self.load.at(self.model, q)
        if self.is_linear:
            units = [replace(at, wrench=np.tile(unit, (len(q), 1))) for unit in np.eye(6)]
            C = np.stack([act(self.law, None, _situation(self.model, one)) for one in units], axis=2)
            return np.asarray(0.5 * (C + C.swapaxes(1, 2)))
        h = act(self.law, None, _situation(self.model, at))
        work = np.einsum("ni,ni->n", h, at.wrench)
        none = np.abs(work) <= ACROSS * np.linalg.norm(h[:, :3], axis=1) * self.load.size
        return np.asarray(np.einsum("ni,nj->nij", h, h) / np.where(none, np.inf, work)[:, None, None])


def with_secants(model: ArmModel, effects: Sequence[PlacedEffect], load: StatedLoad) -> ArmModel:
    """The arm with its effects of stage "arm" as compliances at a stated load; itself where it has none of them.

    Parameters
    ----------
    model : the arm with its effects of stage "model" in it
    effects : what the arm has beyond it (:func:`fem.effects.reading_effects`)

    Raises
    ------
    InputError
        A law that fails, or a parallelogram that is flat at a pose of a trial.
    """
    model = plain(model)
    of_the_arm = [one for one in effects if one.effect.of_the_arm]
    carried = tuple(e for e in of_the_arm if e.effect.stage == "arm" and not e.effect.needs_clock)
    if not of_the_arm:
        return model
    joints: dict[str, list[PlacedEffect]] = {}
    further, bent = [], []
    for law in carried:
        joint, is_linear = _kind(model, law, load)
        bent += [] if is_linear else [law]
        if joint is None:
            further.append(SecantPart(law, model, load, is_linear))
        else:
            joints.setdefault(joint, []).append(law)
    parts = tuple(
        replace(part, axial=SecantSpring(part.axial, part.name, tuple(joints[part.name]), model, load))
        if part.name in joints
        else part
        for part in model.joints
    )
    out = tuple(e for e in of_the_arm if all(e is not law for law in carried))
    return replace(model, joints=parts, secants=Secants(load, model, carried, tuple(bent), out, tuple(further)))


def worth(model: ArmModel, q: Array) -> Array:
    """Stiffness (n,) N/m along the stated load with what was left out, less that without it: its largest change.

    ``model``: with secants. Laws that go by the clock or the temperature are tried at the beginning, in the middle and
    at the end of a campaign.
    """
    secants = model.secants
    assert secants is not None  # noqa: S101 - asked of arms that leave something out
    at, n = secants.load.at(model, q), len(q)
    unit = secants.load.force / secants.load.size
    plain = deflection(model, q, at.wrench, at.point)[:, :3] @ unit
    # One campaign that comes to every pose at its beginning, in its middle and at its end.
    times = np.repeat([0.0, 0.5, 1.0], n)
    then = replace(plain_history(3 * n), clock=times)
    often = LoadedPoses(np.tile(at.q, (3, 1)), np.tile(at.wrench, (3, 1)), np.tile(at.point, (3, 1)))
    d = observed(secants.plain, often, (*secants.carried, *secants.left_out), then)[:, :3] @ unit
    change = secants.load.size * (1.0 / d.reshape(3, n) - 1.0 / plain)
    return np.asarray(np.take_along_axis(change, np.abs(change).argmax(axis=0)[None], axis=0)[0])


def _situation(model: ArmModel, at: LoadedPoses) -> Situation:
    return Situation(model, at, plain_history(len(at)))


def _kind(model: ArmModel, law: PlacedEffect, load: StatedLoad) -> tuple[str | None, bool]:
    """The joint whose spring a law is in series with, None for another law; and whether it is linear in the load."""
    q = trial_poses(model.robot, 64 * TRIED, TRIED)
    # Any load but one that happens to miss a part; that of the table may.
    probe = load.size * np.array([0.3, -0.5, 0.8, 0.4, 0.7, -0.6])
    once = replace(load.at(model, q), wrench=np.tile(probe, (len(q), 1)))
    s = _situation(model, once)
    h = act(law, None, s)
    twice = act(law, None, _situation(model, replace(once, wrench=2.0 * once.wrench)))
    scale = float(np.abs(h).max(initial=0.0))
    # Below the torque at which something slips nothing says that it is linear beyond.
    is_linear = scale > 0.0 and bool(np.abs(twice - 2.0 * h).max() <= SAME * scale)
    joint = law.effect.place
    if joint not in model.robot.joint_names:
        return None, is_linear
    row = s.row(joint).T
    size = np.einsum("nk,nk->n", row, row)[:, None]
    turn = np.einsum("nk,nk->n", row, h)[:, None] / size
    # Nothing but this joint turns, and it does not turn without a torque of its own.
    alone = np.abs(h - turn * row).max(initial=0.0) <= SAME * scale
    across = once.wrench - (s.torque(joint)[:, None] / size) * row
    free = np.abs(act(law, None, _situation(model, replace(once, wrench=across)))).max(initial=0.0)
    return (joint if alone and free <= SAME * scale else None), is_linear
