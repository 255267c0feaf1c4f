"""A map as asked for, by command, Python or cluster: of joints, a slice, a box or a cylinder, and what evaluates it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, get_args

import numpy as np

from fem import LINK_KINDS, ArmModel
from fem.arm import Arm
from machining import GammaRange
from machining.stiffness.map_rows import index_rows
from robots import InputError, ModelDescription, Robot, content_hash, require_positive
from robots.arrays import Array
from robots.constants import DOWN
from robots.robot import middle_pose
from stiffarm import __version__
from stiffarm.request import DIRECTION, FRAME, NAMES, Kind, Request, numbers_of, option, options_of, seed, word
from stiffarm.session.caution import warned
from stiffarm.session.parsing import frame_words, parse_numbers, parse_word
from stiffarm.session.stated import Given, at_load, propagated
from stiffarm.session.task_options import Range, gammas_of, parse_range, values_of
from surrogate.maps import candidates
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import REFUSED
from surrogate.maps.data import Layout, LayoutKind
from surrogate.maps.layouts import (
    ALONG,
    PLANES,
    Reach,
    TURN_deg,
    range_for,
    reach_of,
    space_layout,
    step_for,
)
from surrogate.maps.poses import BestGamma, Extreme, PoseRule, away_from_singular, check_robot, last_joint_is_free
from surrogate.maps.quantities import TABLE, Quantities, Quantity, named, uncertainty

Pose = Literal["fixed", "best-gamma", "stiffest", "softest"]
Plane = Literal["xz", "yz", "xy"]
Vector = Sequence[float] | Array
# Angles of best-gamma by default, deg; the best is then sought between them.
GAMMA_deg: Range = (-180.0, 180.0, 15.0)
# Up to so many points the share of each part is kept: they take more room than all else together.
SHARES_UP_TO = 1_000_000
FORMATS: Final = ("vtu", "vti", "vtp")
# Fields of a request that change nothing at a map's points.
_OF_FILES: Final = ("format", "html", "pictures", "dask", "work")
_FORM: Final = "FROM:TO:STEP or one number"
_REACH: Final = f"{_FORM}. Default: all in reach."


def vector_words(vector: Vector) -> str:
    """A vector as files say it."""
    return " ".join(f"{v + 0.0:.6g}" for v in vector)


def table_of(normal: Vector = (0.0, 0.0, 1.0), relative_sd: Callable[[Array], Array] | None = None) -> tuple[Any, ...]:
    """All quantities that a map can have; with ``relative_sd``, poses -> (n,), the uncertainty of the stiffness."""
    return (*TABLE, *index_rows(normal), *(() if relative_sd is None else (uncertainty(relative_sd),)))


# What users may ask for, and what a pose may be chosen by.
SHORTS: tuple[str, ...] = (*(row.short for row in table_of()), "uncertainty")
MERITS: tuple[str, ...] = tuple(row.short for row in table_of() if row.merit is not None)


def _ranged(value: Any, name: str) -> Range:
    row = numbers_of(value, name, _FORM)
    if len(row) not in (1, 3):
        raise InputError(name, code="A004", value=value, allowed=_FORM)
    return row[0] if len(row) == 1 else (row[0], row[1], row[2])


def _range(metavar: str, unit: str, example: str) -> Kind:
    return Kind(
        metavar,
        lambda text, name: parse_range(text, name, unit, example),
        _ranged,
        lambda value: ":".join(f"{v:g}" for v in np.atleast_1d(value)),
    )


def _row_of(text: str, name: str) -> tuple[float, ...]:
    values = parse_numbers(text)
    if values is None:
        raise InputError(
            name, code="A004", value=text, allowed="numbers as in -90,0,90", remedy=f"write {name} -90,0,90"
        )
    return values


MM: Final = _range("MM", "mm", "-600:600:25")
DEG: Final = _range("DEG", "deg", "-90:90:15")
GAMMA: Final = _range("FROM:TO:STEP", "deg", "-180:180:15")
NUMBERS: Final = Kind("DEG,...", _row_of, lambda value, name: numbers_of(value, name, "numbers as in -90,0,90"))


@dataclass(frozen=True, kw_only=True, eq=False)
class MapRequest(Request):
    """What every map is asked: the tool, the surface, the load that the stiffness is stated at, and its files."""

    kind: ClassVar[LayoutKind]

    tool: Vector | None = option(
        "Tool frame on the flange, in mm and deg (a, b, c about the fixed axes x, y, z in this order); its z axis "
        "points out of the holder through the tip. Default: the model's tool.",
        FRAME,
    )
    normal: Vector = option("Surface normal of k_fs and others, in base axes.", DIRECTION, default=(0.0, 0.0, 1.0))
    format: Sequence[str] | None = option(
        f"File formats of the map: {', '.join(FORMATS)}. Default: vti of a slice or box, otherwise vtu.", NAMES
    )
    html: bool = option("Write an interactive page of the map, to turn it and pick points.", default=False)
    pictures: bool = option("Draw PNG pictures.", default=True, spelled=("--pictures/--no-pictures",))
    dask: str | None = option("Compute the map on a Dask cluster, as in tcp://host:8786.", metavar="ADDRESS")
    work: Path | None = option("Folder for finished blocks; an interrupted run resumes from it.")
    at_load: float | None = option(
        "Load in N at which stiffness is stated, for a model with effects that are not linear in the load, such as "
        "backlash. Default: of the loads it was calibrated with, the one nearest to the rated load.",
        metavar="N",
    )
    seed: int = seed()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.format or ():
            parse_word(name, FORMATS, "--format")
        if "vti" in (self.format or ()) and not self.is_image:
            raise InputError(
                f"--format vti of a map over {self.kind}", code="A001", allowed="a slice or a box", remedy="take vtu"
            )

    @property
    def writes_by(self) -> str | None:
        """A map takes a while, and what it found is for files."""
        return "a map"

    @property
    def is_image(self) -> bool:
        """Whether the points are those of an image in base axes."""
        return self.kind in ("slice", "box")

    @property
    def formats(self) -> tuple[str, ...]:
        """Endings of the files of arrays."""
        return tuple(self.format or (("vti",) if self.kind in ("slice", "box") else ("vtu",)))

    @property
    def along(self) -> tuple[float, float, float]:
        """Direction of the load, its largest component 1, so that no square overflows later."""
        raise NotImplementedError

    def stated(self, given: Given) -> Given:
        """The arm at the load that the map is asked for."""
        return at_load(given, self.at_load, self.along, self.frame(given.robot)[:3, 3])

    def frame(self, robot: Robot) -> Array:
        """Tool frame on the flange (4, 4) m."""
        return robot.T_flange_tool if self.tool is None else np.asarray(self.tool)

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        raise NotImplementedError

    def engine(self, given: Arm) -> Engine:
        """What evaluates the map, of an arm of :meth:`stated`."""
        raise NotImplementedError

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, in words by name, as its files say it."""
        return {
            "robot": given.robot.name,
            "model_hash": content_hash(given.description),
            "links": given.model.link_kind,
            "load_path": given.model.load_path,
            "tool_on_flange": frame_words(self.frame(given.robot)),
            "normal": vector_words(self.normal),
            "not_checked": "collisions; the way from point to point",
        } | warned(given)

    def key(self, given: Arm) -> str:
        """SHA-256 of all that a block depends on."""
        asked = {name: getattr(self, name) for name in options_of(type(self)) if name not in _OF_FILES}
        of = [__version__, content_hash(given.description), given.model.link_kind, given.model.load_path]
        return hashlib.sha256(json.dumps([*of, self.kind, asked], sort_keys=True, default=_listed).encode()).hexdigest()


def _listed(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else repr(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmMapRequest(MapRequest):
    """What a map of the arm's stiffness is asked: the load's direction and the quantities."""

    direction: Vector = option("Direction of the load in base axes.", DIRECTION, default=DOWN)
    values: Sequence[str] | None = option(
        f"Quantities to map: {', '.join(SHORTS)}. Default: the usual ones the model can give.",
        NAMES,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.values or ():
            parse_word(name, SHORTS, "--values")

    @property
    def along(self) -> tuple[float, float, float]:
        """Direction of the load, its largest component 1, so that no square overflows later."""
        return scaled(self.direction)

    @property
    def pose_words(self) -> str:
        """Which pose stands at a point, for people."""
        return "given by the grid"

    def note(self, robot: Robot) -> str | None:
        """What a map of this robot may lack, in words. Errors as :func:`surrogate.maps.poses.check_robot`."""
        return None

    def engine(self, given: Arm) -> Engine:
        """What evaluates the map, of an arm of :meth:`stated`.

        Raises
        ------
        InputError
            Ranges that do not fit, quantities that the model cannot give, a robot that such a map cannot be made of.
        """
        self.note(given.robot)
        grid, rows, point = self.grid(given.robot), self.rows(given), self.frame(given.robot)[:3, 3]
        shares = any(row.short == "softest" for row in rows) and grid.n <= SHARES_UP_TO
        quantities = Quantities(given.model, np.array(self.along), rows, shares=shares, point=point)
        return Engine(grid, quantities, *self.placed(given.robot, quantities), self.seed)

    def placed(self, robot: Robot, quantities: Quantities) -> tuple[PoseRule | None, candidates.Arm | None]:
        """How the pose at a point is chosen; nothing where the grid gives it."""
        return None, None

    def rows(self, given: Arm) -> tuple[Quantity, ...]:
        """The quantities of the map."""
        point = self.frame(given.robot)[:3, 3]
        sd = uncertainty_of(given.description, given.model, np.array(self.along), point)
        if "uncertainty" in (self.values or ()) and sd is None:
            raise InputError(
                "--values uncertainty",
                code="M013",
                value="the model does not say how sure its numbers are",
                allowed="a calibrated model",
                remedy="leave it out, or take the model.toml of `stiffarm calibrate`",
            )
        table = table_of(self.normal, sd)
        return named(table, [row.short for row in table if row.common] if self.values is None else self.values)

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, in words by name, as its files say it."""
        out = {
            "load": f"force along {vector_words(self.along)} (base axes)",
            "load_direction": vector_words(self.along),
            "pose": self.pose_words,
            "stiffness_from": "model",
        }
        held = {f"at_{name}": f"{v:g} mm" for name, v in engine.grid.held.items()}
        return super().metadata(given, engine) | out | held


@dataclass(frozen=True, kw_only=True, eq=False)
class SpaceRequest(ArmMapRequest):
    """What a map over points in space is asked: which pose stands at a point."""

    pose: Pose = option(
        f"Which pose to use at a point: {', '.join(get_args(Pose))}. The last two look at all orientations and "
        "branches.",
        word(Pose),
        default="stiffest",
    )
    best_by: str = option(f"Quantity by which --pose chooses: {', '.join(MERITS)}.", default="stiffness")
    tool_axis: Vector | None = option(
        "Tool axis from the tip into the holder, in base axes, with --pose fixed or best-gamma. Default: 0,0,1.",
        DIRECTION,
    )
    gamma_deg: Range | None = option(
        "Angles gamma about the tool axis, in deg. Default: 0 with --pose fixed, -180:180:15 with best-gamma.",
        GAMMA,
        spelled=("--gamma",),
    )
    step_mm: float | None = option(
        "Step of axes without values, in mm. Default: that of the others, or a round one.",
        metavar="MM",
        spelled=("--step",),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_word(self.best_by, MERITS, "--best-by")
        require_positive("--step", self.step_mm, code="A004")
        for name, value in (("--tool-axis", self.tool_axis), ("--gamma", self.gamma_deg)):
            if value is not None and self.any_orientation:
                raise InputError(
                    f"{name} cannot be combined with --pose {self.pose}, which takes any orientation",
                    code="A002",
                    remedy="choose --pose fixed or --pose best-gamma",
                )

    @property
    def any_orientation(self) -> bool:
        """Whether the tool may stand in any way at a point."""
        return self.pose in ("stiffest", "softest")

    @property
    def pose_words(self) -> str:
        """Which pose stands at a point, for people."""
        if self.any_orientation:
            regular = " away from singular poses" if self.pose == "stiffest" else ""
            return f"{self.pose} of all orientations and branches{regular}, by {self.best_by}"
        chosen = "best gamma and branch"
        if self.pose == "fixed":
            chosen = f"gamma {np.degrees(self._gammas()[0]):g} deg, best branch"
        return f"tool axis {vector_words(self._axis)}, {chosen} by {self.best_by}"

    def reach(self, robot: Robot) -> Reach:
        """What the tool gets to."""
        return reach_of(robot, self.frame(robot)[:3, 3])

    def note(self, robot: Robot) -> str | None:
        """What a map of this robot may lack, in words."""
        return check_robot(robot, any_orientation=self.any_orientation)

    def placed(self, robot: Robot, quantities: Quantities) -> tuple[PoseRule | None, candidates.Arm | None]:
        """How the pose at a point is chosen."""
        frame = self.frame(robot)
        merit = quantities.merit(named(table_of(self.normal), [self.best_by])[0])
        free = last_joint_is_free(robot, frame, lambda q: quantities.poses(q).translational)
        rule: PoseRule = Extreme("softest" if self.pose == "softest" else "stiffest")
        if not self.any_orientation:
            rule = BestGamma(self._axis, np.array(self._gammas()))
        if self.pose != "softest":
            merit = away_from_singular(robot, frame[:3, 3], merit)
        return rule, candidates.Arm(robot, frame, merit, free)

    def along_axes(self, robot: Robot, names: str) -> dict[str, Array]:
        """Values (mm) along axes: those given; else all in reach, in the finest step given or a round one."""
        reach = self.reach(robot)
        ends = {name: 1e3 * np.array([reach.lower[i], reach.upper[i]]) for i, name in enumerate("xyz")}
        ends["r"] = np.array([0.0, 1e3 * reach.radius])
        asked = {name: getattr(self, f"{name}_mm") for name in names}
        given = {name: values_of(v, f"--{name}") for name, v in asked.items() if v is not None}
        steps = [float(v[1] - v[0]) for v in given.values() if len(v) > 1]
        longest = max(float(np.ptp(ends[name])) for name in names)
        step = self.step_mm or (min(steps) if steps else step_for(longest, ALONG[self.kind]))
        return {
            name: given[name] if name in given else range_for(float(ends[name][0]), float(ends[name][1]), step)
            for name in names
        }

    @property
    def _axis(self) -> Array:
        return np.asarray((0.0, 0.0, 1.0) if self.tool_axis is None else self.tool_axis, dtype=np.float64)

    def _gammas(self) -> list[float]:
        """Angles gamma, rad."""
        default = 0.0 if self.pose == "fixed" else GAMMA_deg
        gammas = gammas_of(default if self.gamma_deg is None else self.gamma_deg)
        angles = gammas.angles.tolist() if isinstance(gammas, GammaRange) else [gammas]
        if (self.pose == "fixed") != (len(angles) == 1):
            allowed, other = "FROM:TO:STEP", "fixed for one angle"
            if self.pose == "fixed":
                allowed, other = "one angle", "best-gamma for a range"
            raise InputError(
                f"--gamma with --pose {self.pose}",
                code="A002",
                value=self.gamma_deg,
                allowed=f"{allowed} in deg",
                remedy=f"choose --pose {other}",
            )
        return angles


@dataclass(frozen=True, kw_only=True, eq=False)
class SliceRequest(SpaceRequest):
    """Map the arm over tool points in a plane of the base frame.

    Examples
    --------
    >>> import stiffarm as sa
    >>> m = sa.map_slice(sa.load("kr60-3", links="rigid"), step_mm=500, pose="best-gamma")
    >>> m.data.layout.kind
    'slice'
    """

    kind: ClassVar[LayoutKind] = "slice"

    plane: Plane = option(f"Plane of the slice: {', '.join(PLANES)}.", word(Plane), default="xz")
    at_mm: float | None = option(
        "Position of the plane along its normal, in mm. Default: 0; for xy half the reachable height.",
        metavar="MM",
        spelled=("--at",),
    )
    x_mm: Range | None = option(f"Values along x, in mm: {_REACH}", MM, spelled=("--x",))
    y_mm: Range | None = option(f"Values along y, in mm: {_REACH}", MM, spelled=("--y",))
    z_mm: Range | None = option(f"Values along z, in mm: {_REACH}", MM, spelled=("--z",))

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        values = self.along_axes(robot, self.plane)
        (third,) = set("xyz") - set(self.plane)
        if getattr(self, f"{third}_mm") is not None:
            raise InputError(
                f"--{third} cannot be combined with --plane {self.plane}, which holds it",
                code="A002",
                remedy=f"give --at MM for {third}",
            )
        at = 0.0 if self.at_mm is None else self.at_mm
        if third == "z" and self.at_mm is None:
            # Half the height that the tool reaches, a round number.
            reach = self.reach(robot)
            at = 50.0 * round(0.5 * 1e3 * float(reach.lower[2] + reach.upper[2]) / 50.0)
        return space_layout(values, {third: at})


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxRequest(SpaceRequest):
    """Map the arm over tool points in a box along the base's axes.

    Examples
    --------
    >>> import stiffarm as sa
    >>> m = sa.map_box(sa.load("kr60-3", links="rigid"), x_mm=(800, 1200, 400), y_mm=0, z_mm=800, pose="best-gamma")
    >>> m.data.layout.n
    2
    """

    kind: ClassVar[LayoutKind] = "box"

    x_mm: Range | None = option(f"Values along x, in mm: {_REACH}", MM, spelled=("--x",))
    y_mm: Range | None = option(f"Values along y, in mm: {_REACH}", MM, spelled=("--y",))
    z_mm: Range | None = option(f"Values along z, in mm: {_REACH}", MM, spelled=("--z",))

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        return space_layout(self.along_axes(robot, "xyz"))


@dataclass(frozen=True, kw_only=True, eq=False)
class CylinderRequest(SpaceRequest):
    """Map the arm over tool points in a cylinder about the base's z axis.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("kr60-3", links="rigid")
    >>> sa.map_cylinder(arm, r_mm=1000, phi_deg=(0, 90, 90), z_mm=800, pose="best-gamma").data.layout.n
    2
    """

    kind: ClassVar[LayoutKind] = "cylinder"

    r_mm: Range | None = option(f"Distances from the z axis, in mm: {_REACH}", MM, spelled=("--r",))
    phi_deg: Range = option(
        f"Angles from x, in deg: {_FORM}.", DEG, default=(-180.0, 180.0, TURN_deg), spelled=("--phi",)
    )
    z_mm: Range | None = option(f"Values along z, in mm: {_REACH}", MM, spelled=("--z",))

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        phi = {"phi": values_of(self.phi_deg, "--phi", "deg", "-90:90:15")}
        return space_layout(self.along_axes(robot, "rz") | phi)


def scaled(direction: Vector) -> tuple[float, float, float]:
    """A direction with the largest component 1."""
    vector = np.asarray(direction, dtype=np.float64)
    x, y, z = (vector / np.abs(vector).max()).tolist()
    return x, y, z


def uncertainty_of(
    description: ModelDescription, model: ArmModel, direction: Array, point: Array
) -> Callable[[Array], Array] | None:
    """Relative standard uncertainty (n,) of poses by the covariance that a calibration left in the model file."""
    table = None if description.calibration is None else description.calibration.uncertainty
    if table is None or propagated(description, model, middle_pose(model.robot)[None], direction, point) is None:
        return None

    def relative(q: Array) -> Array:
        found = propagated(description, model, q, direction, point)
        assert found is not None  # noqa: S101 - it was a line before
        return found.relative_sd

    return relative


@dataclass(frozen=True, eq=False)
class MapJob:
    """What a cluster's worker is sent: the request, the arm that it is of, and the version of stiffarm that asks."""

    asked: MapRequest
    description: ModelDescription
    links: str
    load_path: str
    key: str
    version: str = __version__

    @classmethod
    def of(cls, asked: MapRequest, given: Arm) -> MapJob:
        """A request of an arm."""
        return cls(asked, given.description, given.model.link_kind, given.model.load_path, asked.key(given))

    def engine(self) -> Engine:
        """What evaluates the request.

        Raises
        ------
        InputError
            Another version of stiffarm asks.
        """
        if self.version != __version__:
            raise InputError(
                "map request: version",
                code="A010",
                value=self.version,
                allowed=__version__,
                remedy="install the same version of stiffarm everywhere",
            )
        kind = next(kind for kind in LINK_KINDS if kind == self.links)
        path = next((path for path in ("parallelogram", "serial") if path == self.load_path), None)
        return self.asked.engine(self.asked.stated(Arm.of(self.description, kind, path)))


_engines: dict[str, Engine] = {}


def evaluate(job: MapJob, number: int) -> dict[str, Any]:
    """One block of a request, on a worker; what is wrong with the request comes back as words."""
    try:
        if job.key not in _engines:
            _engines.clear()
            _engines[job.key] = job.engine()
        engine = _engines[job.key]
        return engine.block(engine.rows(number))
    except InputError as error:
        return {REFUSED: str(error)}
