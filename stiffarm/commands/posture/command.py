"""The command `posture`: from a part's path to the posture along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective
from machining.cutting import stiffness_uncertainty
from machining.posture import posing
from machining.programs.run import deflects
from machining.stiffness.objective import DISPLACEMENTS, ROOM
from robots import InputError
from robots.arrays import Array
from stiffarm.capability import capability
from stiffarm.commands.posture.result import result
from stiffarm.request import option, seed, word
from stiffarm.result import Result
from stiffarm.session.console import progress
from stiffarm.session.path_request import GAMMA, CourseRequest, effects_left_out
from stiffarm.session.softness import require_springs
from stiffarm.session.task_options import gammas_of

# A range so narrow (rad) is one angle.
FIXED_HALF_WIDTH = 1e-10
QUANTITIES = (*INDICES, *DISPLACEMENTS, ROOM)


@dataclass(frozen=True, kw_only=True)
class PostureRequest(CourseRequest):
    """Find the stiffest posture along a tool path.

    Chooses the angle gamma about the tool axis, branch and turns of the joints such that the arm can follow the path.
    Writes report.html, axes.html (an axes map in which you can drag the course), posture.csv and posture.json into
    --out.

    Examples
    --------
    >>> import stiffarm as sa
    >>> files = "docs/examples/kr60_posture"
    >>> found = sa.posture("kr60-3", f"{files}/path.csv", cell=f"{files}/cell.toml", gamma=(-180, 180, 30))
    >>> bool(found["mean_k_fs"][0] > 0)
    True
    """

    gamma: float | Sequence[float] = option(
        "Angles gamma about the tool axis, in deg; the two ends of a full turn count once.",
        GAMMA,
        default=(-180.0, 180.0, 5.0),
    )
    before: float = option("Gamma of the existing program, in deg, for comparison.", metavar="DEG", default=0.0)
    quantity: str | None = option(
        f"Quantity to optimise: {', '.join(QUANTITIES)} (to joint limits and singularities). Default: k_fs; {ROOM} for "
        "an arm of which no stiffness is known.",
        word(QUANTITIES),
        metavar="NAME",
    )
    aim: Literal["mean", "worst"] = option(
        "Optimise the mean over the points of the path, or the worst point: mean or worst.",
        word(("mean", "worst")),
        default="mean",
    )
    jump: float = option(
        "Maximum joint motion between two neighbouring points, in deg.", metavar="DEG", default=20.0, least=1e-6
    )
    gamma_step: float | None = option(
        "Maximum change of gamma from point to point, in deg; 0 for one gamma along the path. Default: no limit.",
        metavar="DEG",
        least=0.0,
    )
    limit_margin: float = option(
        "Distance to keep from the joint limits, in deg.", metavar="DEG", default=0.5, least=0.0
    )
    seed: int = seed()


def answer(given: Arm, asked: PostureRequest) -> Result:
    """The course along the path beside others, with intervals."""
    arm = asked.at_its_load(given.as_designed)
    setup = asked.setup(arm)
    springless = not deflects(arm.model)
    if springless and (asked.force is not None or asked.milling is not None or asked.quantity not in (None, ROOM)):
        require_springs(arm, "posture")
    path = asked.given_path()
    task = setup.task(path, asked.counts_from)
    cut = None if springless else asked.cut(setup.cell, path.motions)
    if cut is not None:
        cut = replace(cut, force=path.acting(cut.force), tool=path.bending(cut.tool))
    drive = asked.limits(
        arm.robot,
        jump=float(np.radians(asked.jump)),
        limit_least=float(np.radians(asked.limit_margin)),
        turn_gain=0.01 * asked.turn_gain,
        gamma_step=np.inf if asked.gamma_step is None else float(np.radians(asked.gamma_step)),
    )
    gammas = gammas_of(asked.gamma)
    request = posing.PostureRequest(
        task,
        _objective(asked, ROOM if springless else "k_fs", None if cut is None else cut.force.along(task).force),
        gammas
        if isinstance(gammas, GammaRange)
        else GammaRange(gammas - FIXED_HALF_WIDTH, gammas + FIXED_HALF_WIDTH, 2),
        setup.drive(drive, given=path),
        float(np.radians(asked.before)),
        asked.seed,
        cut,
        tuple(effects_left_out(arm)),
        stiffness_uncertainty(arm.model, arm.description, arm.own),
    )
    with progress("posture along the path") as bar:
        posed = posing.pose_along(arm.model, request, bar)
    return result(arm, posed, setup, path)


def _objective(asked: PostureRequest, usual: str, force: Array | None) -> Objective:
    name = asked.quantity or usual
    if force is None and name != ROOM and (name in DISPLACEMENTS or "force" in INDICES[name].uses):
        raise InputError(f"--quantity {name} needs a force", code="A003", remedy="give --force or --milling")
    return Objective(name, force, asked.aim)


posture = capability("posture", PostureRequest, answer)
