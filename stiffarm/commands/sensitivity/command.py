"""Which parameter moves the tool most: the published factorial of joint stiffnesses, or a screening of any numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign, bundled_campaign, load_campaign
from doe.tables.loaded import select_poses
from fem.arm import Arm
from robots import InputError, require_one_of
from stiffarm.capability import capability
from stiffarm.commands.sensitivity import factorial
from stiffarm.commands.sensitivity import screening as screenings
from stiffarm.commands.sensitivity.screening import Method
from stiffarm.request import NAMES, READINGS, Readings, Request, argument, option, readings_asked, seed, word
from stiffarm.result import Result
from stiffarm.session import steps

SAMPLES, TRAJECTORIES = 512, 40
METHODS: tuple[Method, ...] = get_args(Method)
# Options that each method has no use for.
UNUSED: dict[str, tuple[str, ...]] = {
    "factorial": ("free", "campaign", "component", "samples", "trajectories"),
    "sobol": ("trajectories",),
    "morris": ("samples",),
    "derivative": ("samples", "trajectories"),
}


@dataclass(frozen=True, kw_only=True)
class SensitivityRequest(Request):
    """Show which parameters matter at which pose.

    By a factorial of the joint stiffnesses (the published method), or by Morris, Sobol or derivatives of any
    parameters.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.sensitivity("fanuc-r2000ic", sa.bundled("fanuc-r2000ic"), joints=["j2", "j3"])
    >>> found["effect_j2"].shape
    (43,)
    """

    data: Readings | None = argument(
        "Measurement table (CSV/XLSX). Default: the robot's bundled table.", READINGS, metavar="[DATA]"
    )
    poses: Sequence[str] | None = option(
        "Pose labels, separated by commas, as in 5,41,77. Default: those of the scheme, otherwise all.", NAMES
    )
    joints: Sequence[str] | None = option(
        "Joints, separated by commas, as in j2,j3. Default: the scheme's, otherwise all that matter.", NAMES
    )
    method: Literal["factorial", "morris", "sobol", "derivative"] | None = option(
        "Method: factorial (the published one), morris, sobol or derivative. Default: factorial.",
        word(Literal["factorial", "morris", "sobol", "derivative"]),
    )
    free: Sequence[str] | None = option(
        "Parameters to vary, separated by commas, as in j2.stiffness,base.ry,forearm.modulus.", NAMES
    )
    campaign: Path | None = option("Campaign file (TOML) whose parameters and ranges are varied.")
    component: str | None = option(
        "Tool displacement component: x, y, z, rx, ry or rz. Default: the translation that was read largest."
    )
    samples: int | None = option(f"Number of samples of a Sobol study, a power of two. Default: {SAMPLES}.", most=2**20)
    trajectories: int | None = option(
        f"Number of trajectories of a Morris study. Default: {TRAJECTORIES}.", least=2, most=10**5
    )
    low: float | None = option(
        "Low level of the joint stiffnesses, in N m/rad. Default: the scheme's, otherwise that of arms of this size."
    )
    high: float | None = option("High level of the joint stiffnesses, in N m/rad. Default: as for --low.")
    seed: int = seed()
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )

    @property
    def study(self) -> Method | None:
        """The screening asked for, by name or by its options; None is the factorial.

        Raises
        ------
        InputError
            Options that the method has no use for, or that exclude each other.
        """
        given = [name for name in UNUSED["factorial"] if getattr(self, name) is not None]
        chosen = self.method or ("factorial" if not given else "morris" if "trajectories" in given else "sobol")
        if unused := [f"--{name}" for name in given if name in UNUSED[chosen]]:
            raise InputError(
                f"{', '.join(unused)}: no option of --method {chosen}",
                code="A003",
                remedy="leave it out, or change --method",
            )
        ways = [f"--{name}" for name in ("joints", "free", "campaign") if getattr(self, name) is not None]
        if len(ways) > 1:
            remedy = f"leave out {ways[0]} or {ways[-1]}"
            raise InputError(f"{' and '.join(ways)}: one of them at a time", code="A002", remedy=remedy)
        return None if chosen == "factorial" else chosen


def answer(given: Arm, asked: SensitivityRequest) -> Result:
    """Effects pose by pose, and which parameter leads."""
    method = asked.study
    campaign = None if asked.campaign is None else load_campaign(asked.campaign)
    table = readings_asked(given, asked.data, confirm_units=asked.confirm_units)
    bundled = bundled_campaign(given.robot.name)
    planned = None if bundled is None else bundled.compare
    springs = tuple(asked.joints or (planned.sensitivity.joints if planned else steps.springs_seen(given, table)))
    for joint in springs:
        require_one_of("--joints", joint, given.robot.joint_names, code="A001", remedy="choose from these")
    levels = _levels(given, springs, bundled, asked)
    at = select_poses(table, _labels(asked, table, planned), "--poses")
    if method is None:
        return factorial.result(given, at, springs, levels)
    found = screenings.study(
        given,
        at,
        method,
        campaign or tuple(asked.free or (f"{j}.stiffness" for j in springs)),
        levels,
        component=asked.component or screenings.read_most(at),
        samples=asked.samples or SAMPLES,
        trajectories=asked.trajectories or TRAJECTORIES,
        seed=asked.seed,
    )
    return screenings.result(given, at, found)


def _levels(
    given: Arm, springs: tuple[str, ...], scheme: Campaign | None, asked: SensitivityRequest
) -> tuple[float, float]:
    """Range of the stiffnesses: as asked, else the scheme's, else that of arms of this size."""
    usual = steps.usual_springs(given, springs) if scheme is None else scheme.springs.ends
    low, high = (own if own is not None else end for own, end in zip((asked.low, asked.high), usual, strict=True))
    if not (0.0 < low < high and np.isfinite(high)):
        raise InputError(
            "--low, --high",
            code="M002",
            value=f"{low:g}, {high:g}",
            allowed="0 < low < high, finite, N m/rad",
            remedy="give the range in which the springs are expected",
        )
    return low, high


def _labels(asked: SensitivityRequest, table: Measurements, planned: Any) -> tuple[str, ...]:
    """The poses named, else those of the scheme if they were measured, else all."""
    every = tuple(dict.fromkeys(table.pose))
    for label in asked.poses or ():
        require_one_of("--poses", label, every, code="A001", remedy="choose from these, separated by commas")
    if asked.poses:
        return tuple(asked.poses)
    scheme = planned.sensitivity.poses if planned and set(planned.sensitivity.poses) <= set(every) else ()
    return scheme or every


sensitivity = capability("sensitivity", SensitivityRequest, answer)
