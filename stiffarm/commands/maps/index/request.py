"""An index map as asked for, in plain typed values: a grid on the part, an objective and angles gamma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective
from machining.stiffness.distribution import EveryGamma
from machining.stiffness.grid import in_box, in_polygon
from machining.stiffness.objective import DISPLACEMENTS
from machining.sweep_parts import MOST
from robots import InputError, Robot, content_hash
from robots.arrays import Array, Bools
from robots.constants import DOWN, MM
from stiffarm.commands.maps.request import MapRequest, Vector, table_of, vector_words
from stiffarm.session.caution import warned
from stiffarm.session.parsing import frame_words, parse_word
from stiffarm.session.task_options import Range, gammas_of, values_of
from surrogate.maps import candidates
from surrogate.maps.blocks import Engine
from surrogate.maps.data import Layout, LayoutKind
from surrogate.maps.layouts import plane_or_box, points_of
from surrogate.maps.quantities import Quantities, named

Aim = Literal["mean", "worst"]
AIMS: Final[tuple[Aim, ...]] = ("mean", "worst")
# Angles that pictures may show at most, and how exactly one must be named (rad): they are written with a few digits.
MOST_SHOWN, SHOWN_AS = 10, np.radians(1e-3)
# Box of the workpiece: from and to by axis; or corners along the grid's first two axes; mm.
Region = Mapping[str, tuple[float, float]] | Sequence[tuple[float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class IndexRequest(MapRequest):
    """An index over a plane or a box of the part at every angle gamma about the tool axis.

    Parameters
    ----------
    x_mm, y_mm, z_mm : along the part's axes; one of them may be one number
    quantity, force, aim : what is made large or small, see :class:`machining.Objective`
    part : frame (4, 4) m in the base frame
    tool_axis : default: along the normal
    workpiece : where the best gamma is sought; None: the whole grid
    partly : whether a gamma may be best that does not reach all of the workpiece
    show_deg : angles to draw and to write to the map's file; None: chosen later

    Raises
    ------
    InputError
        What does not fit.
    """

    kind: LayoutKind = "box"
    gamma_deg: Range | None = (-180.0, 180.0, 5.0)
    quantity: str = "k_fs"
    force: Vector | None = None
    part: Array | None = None
    aim: Aim = "mean"
    workpiece: Region | None = None
    partly: bool = False
    show_deg: Sequence[float] | None = None

    def __post_init__(self) -> None:
        parse_word(self.quantity, (*INDICES, *DISPLACEMENTS), "--quantity")
        parse_word(self.aim, AIMS, "--aim")
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
    def along(self) -> tuple[float, float, float]:
        """Direction of the force; where none is needed, straight down."""
        return MapRequest(kind="box", direction=DOWN if self.force is None else self.force).along

    @property
    def axis(self) -> Array:
        """Tool axis (3,) from the tip into the holder."""
        return np.asarray(self.normal if self.tool_axis is None else self.tool_axis, dtype=np.float64)

    @cached_property
    def points_of_grid(self) -> Layout:
        """The map's points."""
        asked = [("--x", self.x_mm), ("--y", self.y_mm), ("--z", self.z_mm)]
        x, y, z = (values_of(0.0 if value is None else value, option) for option, value in asked)
        return plane_or_box(x, y, z, np.eye(4) if self.part is None else self.part)

    @cached_property
    def gamma(self) -> Array:
        """Angles gamma (m,) rad."""
        gammas = gammas_of(0.0 if self.gamma_deg is None else self.gamma_deg)
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
        return in_box(self.points_of_grid, *(MM * ends.T))

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
        part = np.eye(4) if self.part is None else self.part
        rule = EveryGamma(
            given.model, self.objective, self.gamma, frame, part, np.asarray(self.normal, dtype=np.float64), self.axis
        )
        merit = quantities.merit(named(table_of(), ["stiffness"])[0])
        return Engine(grid, quantities, rule, candidates.Arm(given.robot, frame, merit), self.seed)

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, words by name."""
        assert isinstance(engine.rule, EveryGamma)  # noqa: S101 - of this request
        frame = engine.rule.T_base_part
        reference = engine.rule.task(points_of(engine.grid)).reference
        return {
            "robot": given.robot.name,
            "model_hash": content_hash(given.description),
            "links": given.model.link_kind,
            "load_path": given.model.load_path,
            "tool_on_flange": frame_words(self.frame(given.robot)),
            "part_in_base": frame_words(frame),
            "normal": vector_words(self.normal),
            "tool_axis": vector_words(self.axis),
            "gamma_counts_from": vector_words(frame[:3, :3] @ np.asarray(reference)),
            "force_N": "none" if self.force is None else vector_words(self.force),
            "not_looked_at": "collisions; the way from point to point",
        } | warned(given)
