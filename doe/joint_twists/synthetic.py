"""A made-up campaign as in the TX200 paper: loads at the flange, relative displacements and twists at each joint.

No such data set is public. What is made here says so: the table in its name and in every row. The truth is a separate
file, which nothing that identifies ever reads.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from doe.joint_twists.cycles import carried
from doe.joint_twists.readings import TwistReadings
from fem import ArmModel
from fem.effects.situation import History
from fem.springs import FourierBasis, LawSpring
from fem.statics.ports import ROWS
from robots import InputError
from robots.arrays import Array, Indices

# Joint stiffness of the 100-270 kg class about the axis (axes 1-3: 4e5 to 4e6, wrist 2e4 to 3e6 N m/rad); tilting
# stiffness of RV gearboxes is 5 to 9 times the torsional one (recalled from catalogues: 110E 294/1470, 160E 392/2940,
# 320E 980/4900 N m/arcmin). Translations are assumed: a few micrometres under 600 N, as a tracker can still see.
TORSION = (2.4e6, 2.0e6, 1.4e6, 6.0e5, 4.0e5, 3.0e5)
TILT = ((6.0, 6.5), (None, 7.0), (6.0, 7.5), (5.5, 6.5), (5.0, 6.0), (5.5, 7.0))
TRANSLATION = (1.2e8, 1.0e8, 8.0e7, 6.0e7, 5.0e7, 4.0e7)
# TX200 paper, section 2.1: joint 2 twists by 0.010 deg about X and 0.017 deg about the gear axis under the same bending
# load: its stiffness about X is the torsional one over 0.59.
TWIST_RATIO_J2 = 0.010 / 0.017
# TX200 paper, section 2.1.
STEPS_N = (150.0, 300.0, 450.0, 600.0)


@dataclass(frozen=True, eq=False)
class Truth:
    """Compliances that the readings are made from: a law a joint and row; ``couplings``: (joint, row, row) -> entry.

    ``friction`` (dof,) N m about the axis, held back on the way up and given back on the way down.
    """

    springs: dict[tuple[int, int], LawSpring]
    friction: Array
    couplings: dict[tuple[int, int, int], float] = field(default_factory=dict)

    def compliances(self, q: Array) -> Array:
        """Compliances (n, dof, 6) of the six rows of every joint."""
        out = np.empty((len(q), q.shape[1], 6))
        for (j, r), spring in self.springs.items():
            out[:, j, r] = spring.compliance(q)
        return out


@dataclass(frozen=True)
class Campaign:
    """What is measured: ``angles`` a joint, ``poses`` of the other joints at each; noise and scatter.

    ``noise_m``, ``noise_rad`` of a reading; ``scatter``: of set-ups, share of the compliance; ``off_axis_m``: in every
    second pose of the last two joints the load acts so far off the flange's axis. Forces at its centre never load
    the last joint's gear, nor the turn of the joint before it about the flange's axis.
    """

    angles: int = 7
    poses: int = 3
    noise_m: float = 3e-6
    noise_rad: float = 10e-6
    scatter: float = 0.02
    off_axis_m: float = 0.15
    steps_N: tuple[float, ...] = STEPS_N  # noqa: N815 - the unit's letter
    unloading: bool = True


def draw_truth(model: ArmModel, rng: np.random.Generator, *, swing: float = 0.12, second: float = 0.0) -> Truth:
    """Stiffnesses of a TX200-like arm with six joints; each varies over its angle by about ``swing``.

    ``second``: a harmonic twice a turn as well, of about that size.

    Raises
    ------
    InputError
        Not six joints.
    """
    if model.robot.dof != 6:
        raise InputError(
            f"synthetic truth for {model.robot.name}: joints", code="J004", value=model.robot.dof, allowed="6"
        )
    springs = {}
    for j in range(6):
        tilt = [TORSION[j] / TWIST_RATIO_J2 if f is None else f * TORSION[j] for f in TILT[j]]
        level = [*(TRANSLATION[j] * np.array([1.0, 1.0, 1.5])), *tilt, TORSION[j]]
        for r, k in enumerate(level):
            phase, size = rng.uniform(0.0, 2.0 * np.pi), swing * rng.uniform(0.5, 1.0)
            coefficients = np.array([np.log(k), size * np.cos(phase), size * np.sin(phase)])
            springs[j, r] = LawSpring(FourierBasis(j, 1), coefficients)
            if second > 0.0:
                phase, size = rng.uniform(0.0, 2.0 * np.pi), second * rng.uniform(0.5, 1.0)
                more = np.array([size * np.cos(phase), size * np.sin(phase)])
                springs[j, r] = LawSpring(FourierBasis(j, 2), np.concatenate([coefficients, more]))
    return Truth(springs, np.array([25.0, 25.0, 15.0, 3.0, 3.0, 1.0]))


def make_readings(
    model: ArmModel,
    truth: Truth,
    campaign: Campaign,
    rng: np.random.Generator,
    *,
    poses: Array | None = None,
    source: str = "synthetic_joint_twists.csv",
) -> TwistReadings:
    """Readings of every joint at its angles: 0 to the top step and back in flange X, Y and Z.

    ``poses`` (joints, angles, poses, dof) rad: drawn where not given (:func:`draw_poses`).
    """
    poses = draw_poses(model, campaign, rng) if poses is None else poses
    up, down = np.array(campaign.steps_N), np.array([*campaign.steps_N[-2::-1], 0.0])
    load = np.concatenate([up, down]) if campaign.unloading else up
    phase = ["loading"] * len(up) + ["unloading"] * (len(load) - len(up))
    dof, angles, times = poses.shape[:3]
    k = dof * angles * times
    q, joint = poses.reshape(k, -1), np.repeat(np.arange(dof), angles * times)
    point = np.zeros((k, 3))
    second = np.tile(np.arange(times) % 2 == 1, dof * angles)
    point[(joint >= dof - 2) & second, 0] = campaign.off_axis_m
    rows = [np.repeat(a, 3, axis=0) for a in (q, point)]
    unit = np.tile(np.hstack([np.eye(3), np.zeros((3, 3))]), (k, 1))
    t = carried(model, rows[0], unit, rows[1])[np.arange(3 * k), np.repeat(joint, 3)]
    y = _responses(truth, q, joint, t.reshape(k, 3, 6), load, campaign, rng)
    n = len(load)
    setup = [f"S{i + 1}/{j + 1}" for i, j in enumerate(joint.tolist())]
    wrench = np.repeat(unit, n, axis=0) * np.tile(load, 3 * k)[:, None]
    return TwistReadings(
        source,
        "0" * 64,
        np.repeat(q, 3 * n, axis=0),
        np.repeat(joint, 3 * n).astype(np.intp),
        wrench,
        np.repeat(point, 3 * n, axis=0),
        y.reshape(-1, 6),
        np.full((3 * k * n, 6), np.nan),
        tuple(phase * (3 * k)),
        tuple(np.repeat(setup, 3 * n).tolist()),
        tuple(range(2, 3 * k * n + 2)),
        True,
        (),
    )


def _responses(
    truth: Truth, q: Array, joint: Indices, t: Array, load: Array, c: Campaign, rng: np.random.Generator
) -> Array:
    """Twists (k, 3, n, 6) of k set-ups under three loads in n steps; t (k, 3, 6) carried per newton."""
    k = len(q)
    C = truth.compliances(q)[np.arange(k), joint]
    # Not below zero: a normal scatter of 2 % never gets there, one of 50 % might.
    C = C * np.maximum(1.0 + c.scatter * rng.standard_normal((k, 6)), 0.05)
    s = t[:, :, None, :] * load[None, None, :, None]
    # A play element: what friction holds back builds up with the torque, stays, and turns round with the course.
    steps, courses = s.shape[2], 3 * k
    course = History(
        np.repeat(np.arange(courses), steps),
        np.tile(np.arange(steps), courses),
        np.zeros(courses * steps),
        is_known=True,
    )
    s[..., 5] = course.play(s[..., 5].ravel(), np.repeat(truth.friction[joint], 3 * steps)).reshape(s.shape[:3])
    y = C[:, None, None, :] * s
    for (j, a, b), entry in truth.couplings.items():
        mine = joint == j
        y[mine, :, :, a] += entry * s[mine][..., b]
        y[mine, :, :, b] += entry * s[mine][..., a]
    sd = np.repeat([c.noise_m, c.noise_rad], 3)
    return np.asarray(y + sd * rng.standard_normal(y.shape))


def draw_poses(model: ArmModel, campaign: Campaign, rng: np.random.Generator) -> Array:
    """Poses (dof, angles, poses, dof): each joint at angles over most of its range, the others drawn anew.

    Set-ups in which the joint's own axis has next to no lever are drawn again, as nobody would measure there.
    """
    robot = model.robot
    low, high = robot.limits.T
    middle, half = (low + high) / 2.0, 0.8 * np.minimum((high - low) / 2.0, np.pi)
    out = np.empty((robot.dof, campaign.angles, campaign.poses, robot.dof))
    for j in range(robot.dof):
        for a, share in enumerate(np.linspace(-1.0, 1.0, campaign.angles) if campaign.angles > 1 else (0.0,)):
            for p in range(campaign.poses):
                tried = middle + 0.7 * half * rng.uniform(-1.0, 1.0, (200, robot.dof))
                tried[:, j] = middle[j] + share * half[j]
                tried = tried[robot.reachable(tried)]
                if not len(tried):
                    raise InputError(
                        f"synthetic poses of {robot.name}: none within limits", code="J004", allowed="a wider range"
                    )
                out[j, a, p] = tried[int(np.argmax(_levers(model, tried[:20], j)))]
    return out


def _levers(model: ArmModel, q: Array, j: int) -> Array:
    """Smallest, over the moments about the joint's axes, of the largest lever that a force at the flange has (n,)."""
    w = np.tile(np.hstack([np.eye(3), np.zeros((3, 3))]), (len(q), 1))
    t = carried(model, np.repeat(q, 3, axis=0), w, np.zeros((3 * len(q), 3)))[:, j].reshape(len(q), 3, 6)
    largest = np.abs(t[:, :, 3:]).max(axis=1)
    return np.asarray(np.sort(largest, axis=1)[:, 1] if j >= len(q[0]) - 2 else largest.min(axis=1))


def truth_table(truth: Truth) -> list[dict[str, object]]:
    """The truth as rows for a file of its own: joint, row, coefficients of ln k over the joint's angle."""
    return [
        {"joint": j + 1, "row": ROWS[r], "ln_k": spring.coefficients.tolist()}
        for (j, r), spring in truth.springs.items()
    ]
