"""What `map` is asked for on the command line: grids, pose rules, quantities, file formats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.arm import Arm
from machining import GammaRange
from robots import InputError, Robot
from robots.arrays import Array
from stiffarm.commands.maps.request import (
    MERITS,
    SHORTS,
    MapRequest,
    grid_table,
    model_text,
    table_of,
    uncertainty_of,
)
from stiffarm.commands.maps.sweep import parse_layers
from stiffarm.session.parsing import parse_direction, parse_names, parse_numbers, parse_vector, parse_word, tool_of
from stiffarm.session.task_options import parse_gammas, parse_values
from surrogate.maps.blocks import POINTS_GIVEN, POINTS_SEARCHED
from surrogate.maps.data import Layout
from surrogate.maps.layouts import (
    ALONG_BOX,
    ALONG_SLICE,
    PLANES,
    Reach,
    TURN_deg,
    box_layout,
    cylinder_layout,
    range_for,
    reach_of,
    slice_layout,
    step_for,
    sweep_layout,
)
from surrogate.maps.poses import check_robot

POSES = ("fixed", "best-gamma", "stiffest", "softest")
FORMATS = ("vtu", "vti", "vtp", "nc")
POINTS = 21
# Angles of best-gamma by default; the best is then sought between them.
GAMMA = "-180:180:15"
# Up to so many points the share of each part is kept by default: they take more room than all else together.
SHARES_UP_TO = 1_000_000
_DEFAULT_FORMAT = {"joints": "vtu", "cylinder": "vtu", "index": "vtu", "slice": "vti", "box": "vti"}


@dataclass(frozen=True, eq=False)
class Asked:
    """A map as asked for: the request, its grid, the formats of its files, and what the grid's tool reaches."""

    request: MapRequest
    grid: Layout
    formats: tuple[str, ...]
    reach: Reach
    pose_words: str
    note: str | None


def check_options(kind: str, options: Mapping[str, str | None]) -> None:
    """Refuse what does not go together, before a model is built.

    Raises
    ------
    InputError
        An unknown word, or an option of another pose rule.
    """
    parse_word(options.get("--plane") or "xz", tuple(PLANES), "--plane")
    pose = parse_word(options.get("--pose") or "stiffest", POSES, "--pose")
    for name in ("--tool-axis", "--gamma"):
        if options.get(name) is not None and pose not in ("fixed", "best-gamma"):
            raise InputError(
                f"{name} cannot be combined with --pose {pose}, which takes any orientation",
                code="A002",
                remedy="choose --pose fixed or --pose best-gamma",
            )
    parse_word(options.get("--best-by") or "stiffness", MERITS, "--best-by")
    parse_names(options.get("--values"), SHORTS, "--values")
    formats_of(kind, options)


def formats_of(kind: str, options: Mapping[str, str | None]) -> tuple[str, ...]:
    """File formats of ``--format``, or the natural one of the kind of map.

    Raises
    ------
    InputError
        An unknown format, or .vti for a grid that is no image.
    """
    formats = parse_names(options.get("--format"), FORMATS, "--format")
    image = kind in ("slice", "box") or (kind == "index" and options.get("--part") is None)
    if formats is not None and "vti" in formats and not image:
        raise InputError(
            f"--format vti of a map over {kind}", code="A001", allowed="a slice or a box", remedy="take vtu"
        )
    return formats or (_DEFAULT_FORMAT[kind],)


def read_map_options(given: Arm, kind: str, options: Mapping[str, str | None], seed: int = 0) -> Asked:
    """The map asked for: ``kind`` joints, slice, box or cylinder, options as typed, None where one is not given.

    Raises
    ------
    InputError
        As :func:`check_options`; ranges and directions that cannot be read; a robot or a model that such a map cannot
        be made of.
    """
    check_options(kind, options)
    robot = given.robot
    tool = tool_of(robot, options.get("--tool"))
    reach = reach_of(robot, tool[:3, 3])
    direction = parse_direction(options.get("--direction") or "0,0,-1")
    normal = parse_vector(options.get("--normal") or "0,0,1", "--normal", "a direction in base axes")
    pose, words = (None, "given by the grid") if kind == "joints" else _pose(options)
    free = pose is not None and pose["rule"] in ("stiffest", "softest")
    note = None if kind == "joints" else check_robot(robot, any_orientation=free)
    grid = _grid(robot, options, kind, reach)
    text, model_hash = model_text(given)
    wanted = _wanted(options, _has_uncertainty(given, direction, tool))
    request = MapRequest(
        model=text,
        model_hash=model_hash,
        links=given.model.link_kind,
        load_path=options.get("--load-path"),
        grid=grid_table(grid),
        pose=pose,
        tool=tool.tolist(),
        direction=list(direction),
        normal=normal.tolist(),
        wanted=list(wanted),
        shares="softest" in wanted and grid.n <= SHARES_UP_TO,
        merit=options.get("--best-by") or "stiffness",
        block=POINTS_SEARCHED if free else POINTS_GIVEN,
        seed=seed,
        at_load=None if options.get("--at-load") is None else float(options["--at-load"] or 0.0),
    )
    return Asked(request, grid, formats_of(kind, options), reach, words, note)


def _has_uncertainty(given: Arm, direction: tuple[float, float, float], tool: Array) -> bool:
    return uncertainty_of(given.description, given.model, np.array(direction), tool[:3, 3]) is not None


def _wanted(options: Mapping[str, str | None], uncertainty: bool) -> tuple[str, ...]:
    named = parse_names(options.get("--values"), SHORTS, "--values")
    if named is None:
        return (*(row.short for row in table_of() if row.common), *(("uncertainty",) if uncertainty else ()))
    if "uncertainty" in named and not uncertainty:
        raise InputError(
            "--values uncertainty",
            code="M013",
            value="the model does not say how sure its numbers are",
            allowed="a calibrated model",
            remedy="leave it out, or take the model.toml of `stiffarm calibrate`",
        )
    # In the order of the table, whatever order they were typed in.
    return tuple(short for short in SHORTS if short in named)


def _grid(robot: Robot, options: Mapping[str, str | None], kind: str, reach: Reach) -> Layout:
    if kind == "joints":
        return sweep_layout(robot, int(options.get("--points") or POINTS), parse_layers(robot, options.get("--layers")))
    if kind == "cylinder":
        height = 1e3 * np.array([reach.lower[2], reach.upper[2]])
        step = _step(options, ("r", "z"), max(1e3 * reach.radius, float(np.ptp(height))), ALONG_BOX)
        r = _values(options, "--r", np.array([0.0, 1e3 * reach.radius]), step)
        z = _values(options, "--z", height, step)
        return cylinder_layout(r, _angles(options.get("--phi")), z)
    ends = {name: 1e3 * np.array([reach.lower[i], reach.upper[i]]) for i, name in enumerate("xyz")}
    if kind == "box":
        step = _step(options, tuple("xyz"), max(float(np.ptp(v)) for v in ends.values()), ALONG_BOX)
        return box_layout(*(_values(options, f"--{name}", ends[name], step) for name in "xyz"))
    plane = options.get("--plane") or "xz"
    up, across, third = PLANES[plane]
    if options.get(f"--{third}") is not None:
        raise InputError(
            f"--{third} cannot be combined with --plane {plane}, which holds it",
            code="A002",
            remedy=f"give --at MM for {third}",
        )
    step = _step(options, (across, up), max(float(np.ptp(ends[name])) for name in (across, up)), ALONG_SLICE)
    return slice_layout(
        plane,
        _values(options, f"--{across}", ends[across], step),
        _values(options, f"--{up}", ends[up], step),
        _number(options, "--at", _middle(reach) if third == "z" else 0.0),
    )


def _middle(reach: Reach) -> float:
    """Half the height that the tool reaches, mm, a round number."""
    return 50.0 * round(1e3 * 0.5 * float(reach.lower[2] + reach.upper[2]) / 50.0)


def _pose(options: Mapping[str, str | None]) -> tuple[dict[str, Any], str]:
    """Rule of the request and its words."""
    rule = parse_word(options.get("--pose") or "stiffest", POSES, "--pose")
    by = options.get("--best-by") or "stiffness"
    if rule in ("stiffest", "softest"):
        regular = " away from singular poses" if rule == "stiffest" else ""
        return {"rule": rule}, f"{rule} of all orientations and branches{regular}, by {by}"
    axis = parse_vector(options.get("--tool-axis") or "0,0,1", "--tool-axis", "a direction in base axes")
    words = "tool axis " + " ".join(f"{v + 0.0:.6g}" for v in axis)
    gammas = parse_gammas(options.get("--gamma") or ("0" if rule == "fixed" else GAMMA))
    angles = gammas.angles.tolist() if isinstance(gammas, GammaRange) else [gammas]
    if (rule == "fixed") != (len(angles) == 1):
        allowed, other = "FROM:TO:STEP", "fixed for one angle"
        if rule == "fixed":
            allowed, other = "one angle", "best-gamma for a range"
        raise InputError(
            f"--gamma with --pose {rule}",
            code="A002",
            value=options.get("--gamma"),
            allowed=f"{allowed} in deg",
            remedy=f"choose --pose {other}",
        )
    chosen = f"gamma {np.degrees(angles[0]):g} deg, best branch" if rule == "fixed" else "best gamma and branch"
    return {"rule": rule, "axis": axis.tolist(), "gammas": angles}, f"{words}, {chosen} by {by}"


def _step(options: Mapping[str, str | None], names: tuple[str, ...], length: float, count: int) -> float:
    """Step in mm of axes without a range: the finest of those that have one, else a round one."""
    given = [parse_values(text, f"--{n}") for n in names if (text := options.get(f"--{n}")) is not None]
    steps = [float(v[1] - v[0]) for v in given if len(v) > 1]
    return min(steps) if steps else step_for(length, count)


def _values(options: Mapping[str, str | None], name: str, ends: Array, step: float) -> Array:
    text = options.get(name)
    return range_for(float(ends[0]), float(ends[1]), step) if text is None else parse_values(text, name)


def _angles(text: str | None) -> Array:
    if text is None:
        return np.linspace(-180.0, 180.0, round(360.0 / TURN_deg) + 1)
    return parse_values(text, "--phi", "deg", "-90:90:15")


def _number(options: Mapping[str, str | None], name: str, otherwise: float) -> float:
    text = options.get(name)
    if text is None:
        return otherwise
    values = parse_numbers(text)
    if values is None or len(values) != 1:
        raise InputError(name, code="A004", value=text, allowed="one number in mm")
    return values[0]
