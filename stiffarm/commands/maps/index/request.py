"""What `map --quantity` is asked for: from options to a grid, a task and an objective, and the map of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective
from machining.stiffness.distribution import best_gamma, distribution, why_not_reached
from machining.stiffness.grid import grid_task, in_box, in_polygon
from machining.stiffness.objective import DISPLACEMENTS
from robots import InputError, content_hash
from robots.arrays import Array, Bools
from robots.progress import Progress
from stiffarm.commands.maps.index.files import IndexMap, drawn_columns
from stiffarm.session.parsing import frame_words, parse_frame, parse_vector, tool_of
from stiffarm.session.task_options import parse_gammas
from surrogate.maps.data import Layout
from surrogate.maps.layouts import plane_or_box

GAMMA = "-180:180:5"
# Share of a step by which a range may miss a whole number of steps: rounding of decimals.
UNEVEN = 1e-6
# Largest number of values along one axis: far beyond what a map can hold.
MOST_VALUES = 100_000


@dataclass(frozen=True, eq=False)
class IndexRequest:
    """A map as asked for.

    ``normal`` and ``axis`` (3,) in base axes; ``gamma`` (m,) rad; ``inside`` (n,): the workpiece, None: the whole
    grid; ``drawn``: columns of gamma for pictures, None: chosen later; ``tool``: as typed, None: the model's.
    """

    grid: Layout
    tool: str | None
    normal: Array
    axis: Array
    gamma: Array
    objective: Objective
    inside: Bools | None
    partly: bool
    drawn: tuple[int, ...] | None


def read_request(options: Mapping[str, str | None]) -> IndexRequest:
    """Read the options of `map --quantity`, None where one is not given.

    Raises
    ------
    InputError
        What cannot be read, or does not fit.
    """
    quantity = options["--quantity"] or ""
    if quantity not in (*INDICES, *DISPLACEMENTS):
        raise InputError("--quantity", value=quantity, allowed=", ".join((*INDICES, *DISPLACEMENTS)))
    # A whole map's aim is what the best gamma is chosen by.
    force, part = options["--force"], options["--part"]
    vector = None if force is None else parse_vector(force, "--force", "N in base axes")
    grid = _grid(options, np.eye(4) if part is None else parse_frame(part, "--part"))
    normal = parse_vector(options["--normal"] or "0,0,1", "--normal", "a direction in base axes")
    axis = options["--tool-axis"]
    gamma = _gamma(options["--gamma"] or GAMMA)
    region = options["--workpiece"]
    return IndexRequest(
        grid=grid,
        tool=options["--tool"],
        normal=normal,
        axis=normal if axis is None else parse_vector(axis, "--tool-axis", "a direction in base axes"),
        gamma=gamma,
        objective=Objective(quantity, vector, _aim(options["--aim"])),
        inside=None if region is None else parse_workpiece(grid, region),
        partly=options["--partly"] is not None,
        drawn=None if options["--show"] is None else _drawn(gamma, options["--show"]),
    )


def map_of(
    given: Arm, asked: IndexRequest, generator: np.random.Generator, progress: Progress | None = None
) -> IndexMap:
    """Make the map.

    Raises
    ------
    InputError
        No point of the grid, or of the workpiece, can be reached at any gamma; else as
        :func:`machining.stiffness.distribution.distribution`.
    """
    tool, T_base_part = tool_of(given.robot, asked.tool), asked.grid.frame
    assert T_base_part is not None  # noqa: S101 - read_request gives it
    R = T_base_part[:3, :3]
    task = grid_task(asked.grid, tool, normal=asked.normal @ R, axis=asked.axis @ R)
    found = distribution(given.model, task, asked.objective, asked.gamma, generator=generator, progress=progress)
    for inside, what in ((None, "grid"), (asked.inside, "workpiece")):
        if not (found.reached if inside is None else found.reached[inside]).any():
            raise InputError(
                f"no point of the {what} can be reached at any gamma",
                value=why_not_reached(given.model, task, asked.gamma) or "no posture was found",
                allowed="one point within reach and joint limits",
                remedy="move the grid or the part, or change the tool or its axis",
            )
    choice, why = None, None
    try:
        choice = best_gamma(found, asked.inside, partly=asked.partly)
    except InputError as error:
        why = str(error)
    metadata = {
        "robot": given.robot.name,
        "model_hash": content_hash(given.description),
        "links": given.model.link_kind,
        "load_path": given.model.load_path,
        "tool_on_flange": frame_words(tool),
        "part_in_base": frame_words(T_base_part),
        "normal": _words(asked.normal),
        "tool_axis": _words(asked.axis),
        "gamma_counts_from": _words(R @ np.asarray(task.reference)),
        "force_N": "none" if asked.objective.force is None else _words(asked.objective.force),
        "not_looked_at": "collisions; the way from point to point",
    }
    drawn = asked.drawn or drawn_columns(asked.gamma, choice)
    return IndexMap(asked.grid, found, asked.inside, choice, why, drawn, metadata)


def parse_values(text: str, option: str) -> Array:
    """Values (n,) m from ``-600:600:25`` or ``486``, mm.

    Raises
    ------
    InputError
        Not numbers, a range that does not ascend or is no whole number of steps, too many values.
    """
    form = "FROM:TO:STEP or one number, mm, FROM below TO, a whole number of steps between them"
    remedy = f"write it as in {option} -600:600:25"
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) not in (1, 3) or not all(map(math.isfinite, values)):
        raise InputError(option, value=text, allowed=form, remedy=remedy)
    if len(values) == 1:
        return np.array(values) * 1e-3
    low, high, step = values
    count = (high - low) / step if step > 0.0 else 0.0
    if not 1.0 - UNEVEN <= count <= MOST_VALUES or abs(count - round(count)) > UNEVEN * max(count, 1.0):
        raise InputError(option, value=text, allowed=form, remedy=remedy)
    return np.linspace(low, high, round(count) + 1) * 1e-3


def parse_workpiece(grid: Layout, text: str) -> Bools:
    """Points (n,) of a grid in ``x=-100:100,y=800:1000``, or within corners ``-100,800;100,800;0,1000``, mm.

    The corners lie along the grid's first two axes. Errors as :func:`machining.stiffness.grid.in_box` and
    :func:`machining.stiffness.grid.in_polygon`, and what cannot be read.
    """
    if ";" in text:
        return in_polygon(grid, _corners(text))
    lower, upper = np.full(3, -np.inf), np.full(3, np.inf)
    for item in text.split(","):
        name, _, ends = (part.strip() for part in item.partition("="))
        try:
            low, high = (float(part) * 1e-3 for part in ends.split(":"))
        except ValueError:
            low, high = math.nan, math.nan
        if name not in ("x", "y", "z") or not low <= high:
            raise InputError(
                "--workpiece",
                value=item,
                allowed="x=FROM:TO, y=FROM:TO, z=FROM:TO in mm, FROM up to TO",
                remedy="write it as in x=-100:100,y=800:1000",
            )
        lower["xyz".index(name)], upper["xyz".index(name)] = low, high
    return in_box(grid, lower, upper)


def _corners(text: str) -> Array:
    try:
        pairs = np.array([[float(v) for v in pair.split(",")] for pair in text.split(";")])
    except ValueError:
        pairs = np.empty((0, 0))
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        raise InputError("--workpiece", value=text, allowed="corners u,v;u,v;u,v in mm", remedy="give three or more")
    return pairs


def _grid(options: Mapping[str, str | None], T_base_part: Array) -> Layout:
    x, y, z = (parse_values(options[name] or "", name) for name in ("--x", "--y", "--z"))
    return plane_or_box(1e3 * x, 1e3 * y, 1e3 * z, T_base_part)


def _gamma(text: str) -> Array:
    gammas = parse_gammas(text)
    return gammas.angles if isinstance(gammas, GammaRange) else np.array([gammas])


def _aim(text: str | None) -> Literal["mean", "worst"]:
    if text not in (None, "mean", "worst"):
        raise InputError("--aim", value=text, allowed="mean, worst", remedy="choose one of them")
    return "worst" if text == "worst" else "mean"


def _drawn(gamma: Array, text: str) -> tuple[int, ...]:
    """Columns of the angles (deg) named; 180 deg stands for -180 where that is the one there."""
    try:
        wanted = np.radians([float(part) for part in text.split(",")])
    except ValueError:
        wanted = np.array([np.nan])
    away = np.abs(np.angle(np.exp(1j * (gamma[None] - wanted[:, None]))))
    # Angles are written with a few digits.
    if not (away.min(axis=1) < np.radians(1e-3)).all() or len(wanted) > 10:
        raise InputError(
            "--show",
            value=text,
            allowed="up to ten angles of --gamma, in deg",
            remedy="choose from its angles, separated by commas",
        )
    return tuple(dict.fromkeys(int(i) for i in away.argmin(axis=1)))


def _words(vector: Array) -> str:
    return " ".join(f"{v + 0.0:.6g}" for v in vector)
