"""What `map index` is asked for: from options to a grid, an objective and angles gamma."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective
from machining.stiffness.grid import in_box, in_polygon
from machining.stiffness.objective import DISPLACEMENTS
from machining.sweep_parts import MOST, TARGETS
from robots import InputError
from robots.arrays import Array, Bools
from stiffarm.commands.maps.request import MapRequest, grid_table, model_text
from stiffarm.session.parsing import parse_frame, parse_numbers, parse_vector, parse_word, tool_of
from stiffarm.session.task_options import parse_gammas, parse_values
from surrogate.maps.data import Layout
from surrogate.maps.layouts import plane_or_box

GAMMA = "-180:180:5"
AIMS: Final[tuple[Literal["mean", "worst"], ...]] = ("mean", "worst")


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
    """Read the options of `map index`, None where one is not given.

    Raises
    ------
    InputError
        What cannot be read, or does not fit.
    """
    quantity = parse_word(options["--quantity"] or "", (*INDICES, *DISPLACEMENTS), "--quantity")
    # A whole map's aim is what the best gamma is chosen by.
    aim = parse_word(options["--aim"] or "mean", AIMS, "--aim")
    force, part = options["--force"], options["--part"]
    vector = None if force is None else parse_vector(force, "--force", "N in base axes")
    grid = _grid(options, np.eye(4) if part is None else parse_frame(part, "--part"))
    normal = parse_vector(options["--normal"] or "0,0,1", "--normal", "a direction in base axes")
    axis = options["--tool-axis"]
    gamma = _gamma(options["--gamma"] or GAMMA)
    if grid.n * len(gamma) > MOST:
        raise InputError(
            "map",
            code="S011",
            value=f"{grid.n} points x {len(gamma)} angles gamma",
            allowed=f"{MOST} in all",
            remedy="make the step of the grid or of gamma larger",
        )
    region = options["--workpiece"]
    return IndexRequest(
        grid=grid,
        tool=options["--tool"],
        normal=normal,
        axis=normal if axis is None else parse_vector(axis, "--tool-axis", "a direction in base axes"),
        gamma=gamma,
        objective=Objective(quantity, vector, aim),
        inside=None if region is None else parse_workpiece(grid, region),
        partly=options["--partly"] is not None,
        drawn=None if options["--show"] is None else _drawn(gamma, options["--show"]),
    )


def map_request(given: Arm, asked: IndexRequest, seed: int) -> MapRequest:
    """The request of the maps' engine: the best gamma's pose at each point, and the objective at every gamma."""
    text, model_hash = model_text(given)
    objective = asked.objective
    force = None if objective.force is None else objective.force.tolist()
    return MapRequest(
        model=text,
        model_hash=model_hash,
        links=given.model.link_kind,
        load_path=given.model.load_path,
        grid=grid_table(asked.grid),
        pose={
            "objective": [objective.quantity, force, objective.aim],
            "axis": asked.axis.tolist(),
            "gammas": asked.gamma.tolist(),
        },
        tool=tool_of(given.robot, asked.tool).tolist(),
        direction=[0.0, 0.0, -1.0] if force is None else force,
        normal=asked.normal.tolist(),
        wanted=["singular"],
        shares=False,
        merit="stiffness",
        block=max(1, TARGETS // len(asked.gamma)),
        seed=seed,
        at_load=None if given.model.secants is None else given.model.secants.load.size,
    )


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
        numbers = parse_numbers(ends, ":")
        if name not in ("x", "y", "z") or numbers is None or len(numbers) != 2 or numbers[0] > numbers[1]:
            raise InputError(
                "--workpiece",
                code="A004",
                value=item,
                allowed="x=FROM:TO, y=FROM:TO, z=FROM:TO in mm, FROM up to TO",
                remedy="write it as in x=-100:100,y=800:1000",
            )
        axis = "xyz".index(name)
        lower[axis], upper[axis] = (1e-3 * number for number in numbers)
    return in_box(grid, lower, upper)


def _corners(text: str) -> Array:
    pairs = [parse_numbers(pair) for pair in text.split(";")]
    if not all(pair is not None and len(pair) == 2 for pair in pairs):
        raise InputError(
            "--workpiece", code="A004", value=text, allowed="corners u,v;u,v;u,v in mm", remedy="give three or more"
        )
    return np.array(pairs)


def _grid(options: Mapping[str, str | None], T_base_part: Array) -> Layout:
    x, y, z = (parse_values(options[name] or "", name) for name in ("--x", "--y", "--z"))
    return plane_or_box(x, y, z, T_base_part)


def _gamma(text: str) -> Array:
    gammas = parse_gammas(text)
    return gammas.angles if isinstance(gammas, GammaRange) else np.array([gammas])


def _drawn(gamma: Array, text: str) -> tuple[int, ...]:
    """Columns of the angles (deg) named; 180 deg stands for -180 where that is the one there."""
    wanted = np.radians(parse_numbers(text) or (np.nan,))
    away = np.abs(np.angle(np.exp(1j * (gamma[None] - wanted[:, None]))))
    # Angles are written with a few digits.
    if not (away.min(axis=1) < np.radians(1e-3)).all() or len(wanted) > 10:
        raise InputError(
            "--show",
            code="A004",
            value=text,
            allowed="up to ten angles of --gamma, in deg",
            remedy="choose from its angles, separated by commas",
        )
    return tuple(dict.fromkeys(int(i) for i in away.argmin(axis=1)))
