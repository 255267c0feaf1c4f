"""An index map as asked for, in plain typed values: a grid on the part, an objective and angles gamma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass
from functools import cached_property
from typing import ClassVar, Final, Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective
from machining.stiffness.distribution import EveryGamma
from machining.stiffness.grid import in_box, in_polygon
from machining.stiffness.objective import DISPLACEMENTS
from machining.sweep_parts import MOST
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.constants import DOWN
from robots.constants import MM as MILLIMETRE
from stiffarm.commands.maps.request import GAMMA, MM, NUMBERS, MapRequest, Vector, scaled, table_of, vector_words
from stiffarm.request import DIRECTION, FORCE, FRAME, Kind, option, word
from stiffarm.session.parsing import frame_words, parse_numbers, parse_word
from stiffarm.session.task_options import Range, gammas_of, values_of
from surrogate.maps import candidates
from surrogate.maps.blocks import Engine
from surrogate.maps.data import Layout, LayoutKind
from surrogate.maps.layouts import plane_or_box, points_of
from surrogate.maps.quantities import Quantities, named

Aim = Literal["mean", "worst"]
# Angles that pictures may show at most, and how exactly one must be named (rad): they are written with a few digits.
MOST_SHOWN, SHOWN_AS = 10, np.radians(1e-3)
# Box of the workpiece: from and to by axis; or corners along the grid's first two axes; mm.
Region = Mapping[str, tuple[float, float]] | Sequence[tuple[float, float]]


def _region(text: str, name: str) -> Region:
    """A region in mm: ``x=-100:100,y=800:1000``, or corners ``-100,800;100,800;0,1000``."""
    if ";" in text:
        pairs = [parse_numbers(pair) or () for pair in text.split(";")]
        if not all(len(pair) == 2 for pair in pairs):
            raise InputError(
                name, code="A004", value=text, allowed="corners u,v;u,v;u,v in mm", remedy="give three or more"
            )
        return [(u, v) for u, v in pairs]
    out: dict[str, tuple[float, float]] = {}
    for item in text.split(","):
        axis, _, ends = (part.strip() for part in item.partition("="))
        numbers = parse_numbers(ends, ":") or ()
        if axis not in ("x", "y", "z") or len(numbers) != 2 or numbers[0] > numbers[1]:
            raise InputError(
                name,
                code="A004",
                value=item,
                allowed="x=FROM:TO, y=FROM:TO, z=FROM:TO in mm, FROM up to TO",
                remedy="write it as in x=-100:100,y=800:1000",
            )
        out[axis] = numbers[0], numbers[1]
    return out


_ALONG: Final = "Values along {} of the part, in mm: FROM:TO:STEP or one number, which one of --x, --y and --z may be."


REGION: Final = Kind("REGION", _region)


@dataclass(frozen=True, kw_only=True, eq=False)
class IndexMapRequest(MapRequest):
    """Map an index over a plane or a box of the part at every angle gamma about the tool axis, and find the best."""

    kind: ClassVar[LayoutKind] = "box"

    x_mm: Range = option(_ALONG.format("x"), MM, default=MISSING, spelled=("--x",))
    y_mm: Range = option(_ALONG.format("y"), MM, default=MISSING, spelled=("--y",))
    z_mm: Range = option(_ALONG.format("z"), MM, default=MISSING, spelled=("--z",))
    quantity: str = option(f"What to map: {', '.join((*INDICES, *DISPLACEMENTS))}.", default="k_fs")
    part: Vector | None = option("Part frame in the base frame, in mm and deg. Default: the base frame.", FRAME)
    tool_axis: Vector | None = option(
        "Tool axis from the tip into the holder, in base axes. Default: along the normal.", DIRECTION
    )
    gamma_deg: Range = option(
        "Angles gamma about the tool axis, in deg, or one; the two ends of a full turn count once.",
        GAMMA,
        default=(-180.0, 180.0, 5.0),
        spelled=("--gamma",),
    )
    show_deg: Sequence[float] | None = option(
        "Angles gamma to draw and to write to the map's file, in deg. Default: five, and the best.",
        NUMBERS,
        spelled=("--show",),
    )
    force: Vector | None = option("Force on the tool in base axes, in N, where needed.", FORCE)
    workpiece: Region | None = option(
        "Where the best gamma is sought, in mm: x=-100:100,y=800:1000, or corners as in "
        "'-100,800;100,800;0,1000' along the grid's first two axes. The best gamma reaches all of it. "
        "Default: the whole grid; a point that the best gamma misses counts as zero stiffness.",
        REGION,
    )
    aim: Aim = option("Best gamma by the mean or the worst point: mean, worst.", word(Aim), default="mean")
    partly: bool = option(
        "Also allow a gamma that does not reach all of the workpiece; each point missed counts as zero stiffness.",
        default=False,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_word(self.quantity, (*INDICES, *DISPLACEMENTS), "--quantity")
        if self.points_of_grid.n * len(self.gamma) > MOST:
            raise InputError(
                "map",
                code="S011",
                value=f"{self.points_of_grid.n} points x {len(self.gamma)} angles gamma",
                allowed=f"{MOST} in all",
                remedy="make the step of the grid or of gamma larger",
            )
        _ = self.objective, self.inside, self.drawn

    @property
    def is_image(self) -> bool:
        """Whether the points are those of an image in base axes."""
        return self.part is None

    @property
    def formats(self) -> tuple[str, ...]:
        """Endings of the files of arrays."""
        return tuple(self.format or ("vtu",))

    @property
    def along(self) -> tuple[float, float, float]:
        """Direction of the force; where none is needed, straight down."""
        return scaled(DOWN if self.force is None else self.force)

    @property
    def axis(self) -> Array:
        """Tool axis (3,) from the tip into the holder."""
        return np.asarray(self.normal if self.tool_axis is None else self.tool_axis, dtype=np.float64)

    @cached_property
    def points_of_grid(self) -> Layout:
        """The map's points."""
        asked = [("--x", self.x_mm), ("--y", self.y_mm), ("--z", self.z_mm)]
        x, y, z = (values_of(value, name) for name, value in asked)
        return plane_or_box(x, y, z, self.frame_of_part)

    @property
    def frame_of_part(self) -> Array:
        """Frame of the part (4, 4) m in the base frame."""
        return np.eye(4) if self.part is None else np.asarray(self.part)

    @cached_property
    def gamma(self) -> Array:
        """Angles gamma (m,) rad."""
        gammas = gammas_of(self.gamma_deg)
        return gammas.angles if isinstance(gammas, GammaRange) else np.array([gammas])

    @cached_property
    def objective(self) -> Objective:
        """What is made large or small."""
        return Objective(self.quantity, None if self.force is None else np.asarray(self.force), self.aim)

    @cached_property
    def inside(self) -> Bools | None:
        """Points (n,) of the workpiece; None: all.

        Errors as :func:`machining.stiffness.grid.in_box` and :func:`machining.stiffness.grid.in_polygon`.
        """
        if self.workpiece is None:
            return None
        if not isinstance(self.workpiece, Mapping):
            return in_polygon(self.points_of_grid, self.workpiece)
        ends = np.array([self.workpiece.get(name, (-np.inf, np.inf)) for name in "xyz"])
        return in_box(self.points_of_grid, *(MILLIMETRE * ends.T))

    @cached_property
    def drawn(self) -> tuple[int, ...] | None:
        """Columns of the angles to show; 180 deg stands for -180 where that is the one there."""
        if self.show_deg is None:
            return None
        wanted = np.radians(self.show_deg)
        away = np.abs(np.angle(np.exp(1j * (self.gamma[None] - wanted[:, None]))))
        if not (away.min(axis=1) < SHOWN_AS).all() or len(wanted) > MOST_SHOWN:
            raise InputError(
                "--show",
                code="A004",
                value=",".join(f"{v:g}" for v in self.show_deg),
                allowed="up to ten angles of --gamma, in deg",
                remedy="choose from its angles, separated by commas",
            )
        return tuple(dict.fromkeys(int(i) for i in away.argmin(axis=1)))

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        return self.points_of_grid

    def engine(self, given: Arm) -> Engine:
        """What evaluates the map: the best gamma's pose at each point, and the objective at every gamma."""
        frame, grid = self.frame(given.robot), self.points_of_grid
        quantities = Quantities(given.model, np.array(self.along), named(table_of(), ["singular"]), point=frame[:3, 3])
        normal = np.asarray(self.normal, dtype=np.float64)
        rule = EveryGamma(given.model, self.objective, self.gamma, frame, self.frame_of_part, normal, self.axis)
        merit = quantities.merit(named(table_of(), ["stiffness"])[0])
        return Engine(grid, quantities, rule, candidates.Arm(given.robot, frame, merit), self.seed)

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, words by name."""
        assert isinstance(engine.rule, EveryGamma)  # noqa: S101 - of this request
        reference = engine.rule.task(points_of(engine.grid)).reference
        part = self.frame_of_part
        return super().metadata(given, engine) | {
            "part_in_base": frame_words(part),
            "tool_axis": vector_words(self.axis),
            "gamma_counts_from": vector_words(part[:3, :3] @ np.asarray(reference)),
            "force_N": "none" if self.force is None else vector_words(self.force),
        }
