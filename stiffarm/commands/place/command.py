"""The command `place`: from a cell, a path and a force to where the robot's base should stand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from fem.arm import Arm
from machining.cell import scene_of
from machining.cutting import stiffness_uncertainty
from machining.placement import AIMS, MODES, Goal, How, Problem, space_of
from machining.placement.problem import Aim
from machining.placement.study import place_along
from machining.setup import Setup
from machining.stiffness.criterion import Criterion
from machining.tooling import require_tools
from robots import InputError
from stiffarm.capability import capability
from stiffarm.commands.place.result import result
from stiffarm.path_request import GAMMA, Axes, PathRequest
from stiffarm.request import ANY_PATH, Kind, numbers_of, option, word
from stiffarm.result import Result
from stiffarm.session.console import progress
from stiffarm.session.parsing import parse_numbers
from stiffarm.session.softness import require_springs
from stiffarm.session.task_options import gammas_of


def _mode(value: Any, name: str) -> str:
    mode, _, steps = str(value).partition(":")
    if mode not in MODES or not (steps.isdecimal() if mode == "steps" else not steps):
        allowed = "fixed, steps:N or moving"
        raise InputError(name, code="A001", value=value, allowed=allowed, remedy=f"as in {name} steps:3")
    return str(value)


def _pair(text: str) -> tuple[float, ...]:
    """One or two numbers with a colon between them; none where it is something else."""
    values = parse_numbers(text, ":")
    return () if values is None or len(values) > 2 else values


def _range(text: str, name: str) -> dict[str, tuple[float, ...]]:
    axis, _, values = text.partition("=")
    return {axis: _pair(values)}


def _ranges(value: Any, name: str) -> dict[str, tuple[float, float]]:
    allowed, remedy = "AXIS=FROM:TO in mm", f"as in {name} rail=-500:1500"
    out = {}
    for axis, ends in value.items() if isinstance(value, Mapping) else {"": ()}.items():
        pair = numbers_of(ends, name, allowed)
        if not axis or len(pair) not in (1, 2):
            raise InputError(name, code="A004", value=value, allowed=allowed, remedy=remedy)
        out[str(axis)] = (pair[0], pair[-1])
    return out


def _table(value: Any, name: str) -> float | tuple[float, ...]:
    allowed = "one angle, or FROM:TO in deg"
    pair = numbers_of(value, name, allowed)
    if len(pair) not in (1, 2):
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy=f"as in {name} -90:90")
    return pair[0] if len(pair) == 1 else pair


MODE: Final = Kind(None, lambda text, name: text, _mode)
RANGE: Final = Kind("AXIS=FROM:TO", _range, _ranges)
TABLE: Final = Kind("DEG or FROM:TO", lambda text, name: _pair(text), _table)


@dataclass(frozen=True, kw_only=True)
class PlaceRequest(PathRequest):
    """Find where the base should stand for the stiffest cut.

    The base stands or moves on the linear axes of the cell. Writes report.html, axes.html (an axes map in which you
    can drag gamma), placement.csv, positions.csv (the result at each base position, or what rules it out) and
    placement.json into --out.
    """

    cell: Path | str = option(
        "Cell file (TOML): linear axes, turntable, part, tool and surroundings.",
        ANY_PATH,
        metavar="CELL.toml",
        required=True,
    )
    force_axes: Axes = option(
        "Axes of --force: part, process (feed, cross-feed, tool axis) or base.",
        word(("part", "process", "base")),
        default="part",
    )
    aim: Aim | None = option(
        "What to optimise: error (surface error under the force), ksf (the criterion K_sf), or mean or worst "
        "(stiffness along the force). Default: error; ksf with --alpha and --beta.",
        word(AIMS),
    )
    mode: str = option(
        "Motion of the base: fixed, steps:N (at most N positions) or moving (along the path).", MODE, default="fixed"
    )
    gamma: float | Sequence[float] = option(
        "Angles gamma about the tool axis, in deg; the two ends of a full turn count once.",
        GAMMA,
        default=(-180.0, 180.0, 10.0),
    )
    gamma_course: bool = option("Let gamma vary along the path where that is better.", default=False)
    range: Mapping[str, Sequence[float]] | Sequence[Mapping[str, Sequence[float]]] = option(
        "Range of a linear axis to search, in mm. May be repeated. Default: the axis limits.", RANGE, several=True
    )
    table: float | Sequence[float] = option("Turntable angle, or range to search, in deg.", TABLE, default=0.0)
    alpha: float | None = option(
        "Weight of sum k^2 in K_sf, in mm^2/N^2; requires --beta. Default: chosen so that the terms are comparable."
    )
    beta: float | None = option(
        "Weight of (mean k)^4 in K_sf, in mm^4/N^4; requires --alpha. Default: chosen so that the terms are comparable."
    )
    by_length: bool = option("Weight sums and means by path length instead of by points.", default=False)
    anywhere: bool = option(
        "With --mode steps: allow the base to move between any two points, not only on rapid moves.", default=False
    )
    cost: float = option(
        "With --mode steps: least improvement that justifies one more move of the base, in percent. With --mode "
        "moving: loss, in percent, accepted to keep axes still during each cut.",
        metavar="PERCENT",
        default=1.0,
    )
    jump: float = option(
        "Maximum joint motion between two neighbouring points, in deg.", metavar="DEG", default=20.0, least=1e-6
    )
    clearance: float | None = option(
        "Distance to keep from the surroundings, in mm. Default: the cell's safety distance.", metavar="MM"
    )
    collisions: bool = option(
        "Keep the arm clear of the cell and its surroundings.",
        default=True,
        spelled=("--collisions/--no-collisions",),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.alpha is None) != (self.beta is None):
            raise InputError(
                "weights of K_sf",
                code="A001",
                value="one of --alpha and --beta",
                allowed="both or none",
                remedy="give both",
            )


def answer(given: Arm, asked: PlaceRequest) -> Result:
    """The placement beside others, with intervals."""
    arm = asked.at_its_load(given.as_designed)
    require_springs(arm, "placement")
    setup = asked.setup(arm)
    assert setup.arm is not None  # noqa: S101 - made with the arm's bodies
    path = asked.given_path()
    require_tools(setup.cell, path.motions)
    cut = asked.cut(setup.cell, path.motions)
    if cut is None:
        raise InputError(
            "place needs a cutting force",
            code="A003",
            allowed="--force, --milling, or milling files of the cell's tools",
            remedy="give one of them",
        )
    criterion = None if asked.alpha is None or asked.beta is None else Criterion(asked.alpha, asked.beta)
    mode, _, steps = asked.mode.partition(":")
    searched = cast("Sequence[Mapping[str, tuple[float, float]]]", asked.range)
    ranges = {axis: (1e-3 * a, 1e-3 * b) for one in searched for axis, (a, b) in one.items()}
    drive = asked.limits(arm.robot, jump=math.radians(asked.jump))
    scene = scene_of(setup.cell, setup.arm) if asked.collisions else None
    problem = Problem(
        model=arm.model,
        space=space_of(setup.cell, ranges, table=_radians(asked.table)),
        path=path.path,
        goal=Goal(
            asked.aim or ("error" if criterion is None else "ksf"), path.drilling(cut.force), criterion, asked.by_length
        ),
        gamma=gammas_of(asked.gamma),
        drive=Setup(setup.cell).drive(drive),
        scene=scene,
        clearance=setup.cell.safety if asked.clearance is None else 1e-3 * asked.clearance,
        free=path.free,
        stiffness=stiffness_uncertainty(arm.model, arm.description, arm.own),
        tools=(setup if asked.collisions else Setup(setup.cell)).tools(path),
    )
    how = How(mode, int(steps) if steps else 2, asked.anywhere, 1e-2 * asked.cost, asked.gamma_course)  # type: ignore[arg-type]
    with progress("place") as bar:
        step = place_along(
            problem, path, how, () if scene is None else scene.notes, lambda _, done, total: bar(done, total)
        )
    return result(arm, step, setup.arm)


def _radians(table: float | Sequence[float]) -> float | tuple[float, float]:
    if isinstance(table, int | float):
        return math.radians(table)
    low, high = np.radians(table).tolist()
    return low, high


place = capability("place", PlaceRequest, answer)
