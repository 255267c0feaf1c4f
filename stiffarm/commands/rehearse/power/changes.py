"""What effects of usual sizes change of planned readings: by the laws of rehearsals, or by the catalogue's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe.diagnosis.candidates import possible
from doe.diagnosis.signatures import signatures
from doe.estimation.noise import Noise
from doe.power.planned import Planned
from fem.arm import Arm
from rehearsal import Arm as WorldArm
from rehearsal import World, hide, nuisance
from rehearsal.evaluate import Truth, exact
from robots import InputError
from robots.arm_class import arm_class
from robots.arrays import Array
from stiffarm.commands.rehearse.sheet import SetUps

# No gauge is believed to be better, m and rad.
FINEST = 5e-7


def middle_springs(given: Arm, world: WorldArm) -> Array:
    """Springs (dof,) N m/rad to plan with: the model's, or the middle of the arm's class where it has none at all."""
    if has_springs(world):
        return np.array([np.inf if k is None else k for k in world.stiffness])
    size = arm_class(given.description, given.robot)
    return np.asarray(np.sqrt(size.low * size.high))


def has_springs(world: WorldArm) -> bool:
    """Whether the model has a spring about any joint."""
    return any(k is not None and np.isfinite(k) for k in world.stiffness)


def planned(given: Arm, world: WorldArm, set_ups: SetUps) -> Planned:
    """The sheet as read without noise, with nothing missing.

    Raises
    ------
    InputError
        Fewer readings than springs, or none that sees one.
    """
    floor = set_ups.noise.floor_m
    table = set_ups.filled(np.where(set_ups.read, exact(_plain(given, world), set_ups.readings), np.nan))
    if isinstance(floor, np.ndarray):
        sigma = np.empty(table.n)
        sigma[set_ups.row] = floor.reshape(-1)
        table = replace(table, sigma=np.maximum(sigma, FINEST))
    n = set_ups.noise
    white = max(float(np.hypot(np.mean(floor), n.resolution_m / np.sqrt(12.0))), FINEST)
    noise = Noise((white, white), n.share, pose_share=n.setup)
    return Planned.of(given.description, given.model, table, noise, given.own)


def by_world(given: Arm, world: WorldArm, set_ups: SetUps, p: Planned, code: str, draws: int, seed: int) -> Array:
    """Changes (m, d) of the readings by an effect that rehearsals hide, drawn as they draw it.

    The springs are those planned with: a diagnosis fits them before it asks what else there is.
    """
    size = arm_class(given.description, given.robot)
    compliance, out = 1.0 / middle_springs(given, world), []
    without = exact(_plain(given, world), set_ups.readings)
    for k in range(draws):
        own = int(np.random.default_rng([seed, k, *code.encode()]).integers(2**31))
        one = hide(
            world,
            code,
            set_ups.readings,
            set_ups.noise,
            seed=own,
            links=given.model.link_kind,
            read=set_ups.read,
            ranges=(size.low, size.high),
        )
        out.append(p.of_readings(set_ups.filled(_change(one, compliance, without)).displacement))
    return np.stack(out, axis=1)


def _plain(given: Arm, world: WorldArm) -> Truth:
    """The arm as planned with: nothing missing, no errors."""
    return Truth(world, 1.0 / middle_springs(given, world), given.model.link_kind, nuisance.nothing(world), (), 0)


def _change(one: World, compliance: Array, without: Array) -> Array:
    """What the hidden effect alone changes of the readings ``without`` it (n, 3), springs ``compliance`` (dof,)."""
    return np.asarray(exact(one.truth.on_springs(compliance), one.readings) - without)


def by_catalogue(p: Planned, code: str, draws: int, seed: int) -> Array:
    """Changes (m, d) of the readings by an effect that no rehearsal hides: usual sizes, any of its shapes."""
    effect, rng = p.effects[code], np.random.default_rng([seed, *code.encode()])
    try:
        some = possible(p.s, effect) if effect.gross else signatures(p.s, effect)
    except InputError:
        some = []
    if not some or not effect.amplitudes:
        return np.zeros((len(p.s.data), 0))
    out = []
    for _ in range(draws):
        c = some[int(rng.integers(len(some)))]
        parameters = [effect.parameters[k] for k in effect.amplitudes]
        size = [np.exp(rng.uniform(np.log(max(q.size[0], 1e-3 * q.size[1])), np.log(q.size[1]))) for q in parameters]
        sign = [rng.choice([-1.0, 1.0]) if q.signed else 1.0 for q in parameters]
        out.append(c.columns @ (np.array(size) * np.array(sign)))
    return np.stack(out, axis=1)
