"""The step `identify`: six stiffnesses a joint from tables of joint twists, and everything that is said about them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from doe import Measurements
from doe.joint_twists import Identified, LawKind, TwistReadings, identify, joined, read_twists
from doe.joint_twists.checks import BendingRatio, DiagonalTest, Loop, bending_ratio, diagonal_tests, loops
from doe.joint_twists.cycles import Branches
from doe.joint_twists.model_file import constant_compliances, with_six_springs
from doe.joint_twists.substitute import (
    Errors,
    Orientation,
    Window,
    compliances_of,
    errors_of,
    loads_in,
    predict,
    reachable_poses,
    stiffness_window,
    stiffness_with,
    usual_models,
)
from fem.arm import Arm
from robots import InputError, ModelDescription, why_no_closed_form
from robots.arrays import Array
from robots.kinematics import forward_kinematics
from stiffarm.session.table_kinds import DEFLECTIONS, TWISTS, Kind, expect

# Random poses that models are compared at.
POSES = 2000
# A force or a lever (N/N, m) below this is rounding.
UNLOADED = 1e-6
# The paper's joint: twist about X against that about the gear axis.
RATIO_JOINT = 1


@dataclass(frozen=True)
class Request:
    """What is asked: law of the stiffnesses (None: chosen), branches used, and the window of the map."""

    law: LawKind | None = None
    branches: Branches = "mean"
    orientation: Orientation = "forward"
    origin_m: tuple[float, float] = (1.344, 0.550)
    size_m: tuple[float, float] = (0.6, 0.6)
    seed: int = 0


@dataclass(frozen=True)
class HeldOut:
    """Directional stiffness (n,) N/m at flange deflections that nothing was identified from.

    ``measured``; ``predicted`` with ``low`` and ``high``; ``labels`` and ``force_N`` (n,).
    """

    source: str
    labels: tuple[str, ...]
    force_N: Array  # noqa: N815 - the unit's letter
    measured: Array
    predicted: Array
    low: Array
    high: Array

    @property
    def error(self) -> Array:
        """Relative error of the prediction (n,)."""
        return np.asarray(self.predicted / self.measured - 1.0)


@dataclass(frozen=True)
class AtFlange:
    """What the stiffnesses make of the flange, over random poses.

    ``same`` and ``refitted``: errors of models of the gears alone, by flange axis, with ``effective`` compliances
    (dof,) of the second; ``file``: errors of the model file where it holds constants; ``spread`` (3,): median half
    width of the intervals of directional stiffness.
    """

    same: Errors
    refitted: Errors
    effective: Array
    file: Errors
    spread: Array


@dataclass(frozen=True)
class JointTwists:
    """A finished identification with its checks and comparisons.

    ``flange`` is None where forces at the flange load stiffnesses that are not identified: ``no_flange`` says which.
    ``window``: the map, or None with the reason in ``no_window``.
    """

    request: Request
    given: Arm
    found: Identified
    description: ModelDescription
    loops: tuple[Loop, ...]
    diagonal: tuple[DiagonalTest, ...]
    bending: BendingRatio | None
    flange: AtFlange | None
    no_flange: str
    window: Window | None
    no_window: str
    held_out: HeldOut | None

    @property
    def synthetic(self) -> bool:
        """Whether the readings were made up."""
        return self.found.data.synthetic


def read_tables(given: Arm, tables: Sequence[Path], model: str = "MODEL") -> TwistReadings:
    """Read one or more tables of joint twists or reflectors as one.

    ``model``: its name in what is said of a table that another command takes.

    Raises
    ------
    InputError
        No such file, a table of another kind, or what is wrong in it.
    """
    for table in tables:
        if not table.is_file():
            raise InputError(
                "TABLE", code="A007", value=str(table), allowed="an existing .csv or .xlsx", remedy="check the path"
            )
        expect(table, TWISTS, model=model, better=lambda kind: _better(given, kind, tables))
    return joined([read_twists(table, given.robot) for table in tables])


def _better(given: Arm, kind: Kind, tables: Sequence[Path]) -> str | None:
    """The command line for a table of tool deflections."""
    from stiffarm.commands.identify.elsewhere import calibrate_command

    return calibrate_command(given, tables) if kind is DEFLECTIONS else None


def run(
    given: Arm,
    data: TwistReadings,
    request: Request,
    *,
    holdout: Measurements | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> JointTwists:
    """Identify, check, compare.

    Raises
    ------
    InputError
        What :func:`doe.joint_twists.identify` refuses; no direction of any joint with a number; a window that the
        arm does not reach.
    """
    model = given.model
    say(f"identifying six stiffnesses at {model.robot.dof} joints from {data.n} readings")
    found = identify(model, data, law=request.law, branches=request.branches)
    if not any(d.law is not None for d in found.directions.values()):
        raise InputError(
            f"{data.source}: no stiffness is determined",
            code="J004",
            remedy="give readings of joints under loads that reach them",
        )
    rng = np.random.default_rng(request.seed)
    q = reachable_poses(model, POSES, rng)
    no_flange = _why_no_flange(given, found, q) or _rigid_way(given, found, q)
    if no_flange and holdout is not None:
        raise InputError(
            f"--holdout {holdout.source}: {no_flange}",
            code="J004",
            remedy="leave out --holdout, or measure those joints too",
        )
    say("comparing with models of the gears alone (one stiffness per joint)" if not no_flange else f"note: {no_flange}")
    window, no_window = (None, f"no map: {no_flange}") if no_flange else _window(given, found, request)
    return JointTwists(
        request,
        given,
        found,
        with_six_springs(given.description, found),
        loops(found),
        diagonal_tests(found),
        bending_ratio(found.directions, found.names[RATIO_JOINT]) if model.robot.dof > RATIO_JOINT else None,
        None if no_flange else _at_flange(given, found, q, rng),
        no_flange,
        window,
        no_window,
        None if holdout is None else _held_out(given, found, holdout),
    )


def _why_no_flange(given: Arm, found: Identified, q: Array) -> str:
    """Which stiffnesses forces at the flange load although nobody identified them; empty if none."""
    s = np.abs(loads_in(given.model, q, np.eye(3))).max(axis=(0, 1)).ravel()
    loaded = [
        f"{joint}.{row}"
        for (joint, row), d, most in zip(found.directions, found.directions.values(), s, strict=True)
        if d.status == "not identified" and most > UNLOADED
    ]
    if not loaded:
        return ""
    return f"no result at the flange: it depends on stiffnesses that are not identified: {', '.join(loaded)}"


def _rigid_way(given: Arm, found: Identified, q: Array) -> str:
    """What is rigid at the flange, where readings left every stiffness that a force loads without a number."""
    stiffest = stiffness_with(given.model, found.compliances(q)[0], q, or_rigid=True).max(axis=0)
    ways = [f"flange {axis}" for axis, most in zip("XYZ", stiffest, strict=True) if np.isinf(most)]
    return f"no result at the flange: nothing identified deflects along {', '.join(ways)}" if ways else ""


def _at_flange(given: Arm, found: Identified, q: Array, rng: np.random.Generator) -> AtFlange:
    model, six = given.model, compliances_of(found)
    same, refitted, effective = usual_models(model, six, poses=POSES, rng=rng)
    reference = stiffness_with(model, six(q), q)
    of_file = errors_of(stiffness_with(model, constant_compliances(found, q), q), reference)
    p = predict(model, found, q)
    spread = np.median((p.high - p.low) / (2.0 * p.value), axis=0)
    return AtFlange(same, refitted, effective, of_file, np.asarray(spread))


def _window(given: Arm, found: Identified, request: Request) -> tuple[Window | None, str]:
    reason = why_no_closed_form(given.robot)
    if reason is not None:
        return None, f"no map: {reason}"
    window = stiffness_window(
        given.model,
        compliances_of(found),
        orientation=request.orientation,
        origin_m=request.origin_m,
        size_m=request.size_m,
    )
    return window, ""


def _held_out(given: Arm, found: Identified, data: Measurements) -> HeldOut:
    """Flange deflections against the model, reading by reading: |F| / |d . F/|F||."""
    F = data.wrench[:, :3]
    size = np.linalg.norm(F, axis=1)
    along = np.einsum("ni,ni->n", data.displacement[:, :3], F) / np.maximum(size, 1e-300)
    use = (size > 0.0) & np.isfinite(along) & (along != 0.0) & ~data.wrench[:, 3:].any(axis=1)
    if not use.any():
        raise InputError(
            f"--holdout {data.source}: no reading with a force and the displacement along it",
            code="J004",
            allowed="fx_N fy_N fz_N and dx_mm dy_mm dz_mm where the force has a part",
            remedy="give deflections of the flange under forces",
        )
    rows = np.flatnonzero(use)
    R = forward_kinematics(given.robot, data.q[rows]).R_flange
    way = np.einsum("nji,nj->ni", R, F[rows]) / size[rows, None]
    parts = [predict(given.model, found, data.q[i : i + 1], way[k : k + 1]) for k, i in enumerate(rows)]
    value, low, high = (np.array([getattr(p, name)[0, 0] for p in parts]) for name in ("value", "low", "high"))
    labels = tuple(data.pose[i] for i in rows)
    return HeldOut(data.source, labels, size[rows], size[rows] / np.abs(along[rows]), value, low, high)
