"""A map as asked for, in plain typed values: of joints, a slice, a box or a cylinder; by command, Python or cluster."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fem import LINK_KINDS, ArmModel
from fem.arm import Arm
from machining import GammaRange
from machining.stiffness.map_rows import index_rows
from robots import InputError, ModelDescription, Robot, content_hash
from robots.arrays import Array, finite
from robots.constants import DOWN
from robots.robot import middle_pose
from stiffarm import __version__
from stiffarm.session.caution import warned
from stiffarm.session.parsing import frame_words, parse_word
from stiffarm.session.stated import Given, at_load, propagated
from stiffarm.session.task_options import Range, gammas_of, values_of
from surrogate.maps import candidates
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import REFUSED
from surrogate.maps.data import Layout, LayoutKind
from surrogate.maps.layouts import (
    ALONG,
    PLANES,
    Reach,
    TURN_deg,
    default_sweep,
    range_for,
    reach_of,
    space_layout,
    step_for,
    sweep_layout,
)
from surrogate.maps.poses import BestGamma, Extreme, PoseRule, away_from_singular, check_robot, last_joint_is_free
from surrogate.maps.quantities import TABLE, Quantities, Quantity, named, uncertainty

POSES = ("fixed", "best-gamma", "stiffest", "softest")
# Angles of best-gamma by default, deg; the best is then sought between them.
GAMMA_deg: Range = (-180.0, 180.0, 15.0)
# Up to so many points the share of each part is kept: they take more room than all else together.
SHARES_UP_TO = 1_000_000

Vector = Sequence[float] | Array


@dataclass(frozen=True, kw_only=True, eq=False)
class MapRequest:
    """A map of an arm over its joints or over points in space. Vectors are in base axes, angles in deg.

    Parameters
    ----------
    points, layers_deg : of joints: values of each swept coordinate, and those of the one that leaves the plane
    plane, at_mm : of a slice: 'xz', 'yz' or 'xy', and where it lies along its normal
    x_mm, y_mm, z_mm, r_mm, phi_deg : values along an axis; None: all that the tool reaches
    step_mm : of axes without values; None: that of the others, or a round one
    pose, best_by : which pose stands at a point (:data:`POSES`), and the quantity by which it is chosen
    tool_axis, gamma_deg : of the poses 'fixed' and 'best-gamma'
    direction : of the load
    values : short names of quantities; None: the usual ones that the model can give
    tool : frame on the flange (4, 4) m; None: the model's
    normal : of the surface that indices are about
    at_load_N : load at which an arm with effects is mapped; None: as usual
    seed : of searches

    Raises
    ------
    InputError
        An unknown word, or values of another pose rule.
    """

    kind: LayoutKind
    points: int = 21
    layers_deg: Sequence[float] | None = None
    plane: str = "xz"
    at_mm: float | None = None
    x_mm: Range | None = None
    y_mm: Range | None = None
    z_mm: Range | None = None
    r_mm: Range | None = None
    phi_deg: Range | None = None
    step_mm: float | None = None
    pose: str = "stiffest"
    best_by: str = "stiffness"
    tool_axis: Vector | None = None
    gamma_deg: Range | None = None
    direction: Vector = DOWN
    values: Sequence[str] | None = None
    tool: Array | None = None
    normal: Vector = (0.0, 0.0, 1.0)
    at_load_N: float | None = None  # noqa: N815 - the unit's letter
    seed: int = 0

    def __post_init__(self) -> None:
        parse_word(self.plane, PLANES, "--plane")
        parse_word(self.pose, POSES, "--pose")
        parse_word(self.best_by, MERITS, "--best-by")
        for name in self.values or ():
            parse_word(name, SHORTS, "--values")
        for option, value in (("--tool-axis", self.tool_axis), ("--gamma", self.gamma_deg)):
            if value is not None and self.any_orientation:
                raise InputError(
                    f"{option} cannot be combined with --pose {self.pose}, which takes any orientation",
                    code="A002",
                    remedy="choose --pose fixed or --pose best-gamma",
                )

    @property
    def any_orientation(self) -> bool:
        """Whether the tool may stand in any way at a point."""
        return self.pose in ("stiffest", "softest")

    @property
    def along(self) -> tuple[float, float, float]:
        """Direction of the load, its largest component 1, so that no square overflows later."""
        vector = finite("--direction", self.direction, (3,))
        if not vector.any():
            raise InputError("--direction", code="A004", value="0, 0, 0", allowed="three finite numbers, not all zero")
        x, y, z = (vector / np.abs(vector).max()).tolist()
        return x, y, z

    @property
    def pose_words(self) -> str:
        """Which pose stands at a point, for people."""
        if self.kind == "joints":
            return "given by the grid"
        if self.any_orientation:
            regular = " away from singular poses" if self.pose == "stiffest" else ""
            return f"{self.pose} of all orientations and branches{regular}, by {self.best_by}"
        chosen = "best gamma and branch"
        if self.pose == "fixed":
            chosen = f"gamma {np.degrees(self._gammas()[0]):g} deg, best branch"
        return f"tool axis {vector_words(self._axis)}, {chosen} by {self.best_by}"

    def stated(self, given: Given) -> Given:
        """The arm at the load that the map is asked for."""
        return at_load(given, self.at_load_N, self.along, self.frame(given.robot)[:3, 3])

    def frame(self, robot: Robot) -> Array:
        """Tool frame on the flange (4, 4) m."""
        return robot.T_flange_tool if self.tool is None else self.tool

    def reach(self, robot: Robot) -> Reach:
        """What the tool gets to."""
        return reach_of(robot, self.frame(robot)[:3, 3])

    def note(self, robot: Robot) -> str | None:
        """What a map of this robot may lack, in words. Errors as :func:`surrogate.maps.poses.check_robot`."""
        return None if self.kind == "joints" else check_robot(robot, any_orientation=self.any_orientation)

    def engine(self, given: Arm) -> Engine:
        """What evaluates the map, of an arm of :meth:`stated`.

        Raises
        ------
        InputError
            Ranges that do not fit, quantities that the model cannot give, a robot that such a map cannot be made of.
        """
        robot, frame = given.robot, self.frame(given.robot)
        self.note(robot)
        grid, rows = self.grid(robot), self.rows(given)
        shares = any(row.short == "softest" for row in rows) and grid.n <= SHARES_UP_TO
        quantities = Quantities(given.model, np.array(self.along), rows, shares=shares, point=frame[:3, 3])
        if self.kind == "joints":
            return Engine(grid, quantities, seed=self.seed)
        merit = quantities.merit(named(table_of(self.normal), [self.best_by])[0])
        free = last_joint_is_free(robot, frame, lambda q: quantities.poses(q).translational)
        rule: PoseRule = Extreme("softest" if self.pose == "softest" else "stiffest")
        if not self.any_orientation:
            rule = BestGamma(self._axis, np.array(self._gammas()))
        if self.pose != "softest":
            merit = away_from_singular(robot, frame[:3, 3], merit)
        return Engine(grid, quantities, rule, candidates.Arm(robot, frame, merit, free), self.seed)

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

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        if self.kind == "joints":
            return sweep_layout(robot, self.points, self._layers(robot))
        reach = self.reach(robot)
        ends = {name: 1e3 * np.array([reach.lower[i], reach.upper[i]]) for i, name in enumerate("xyz")}
        ends["r"] = np.array([0.0, 1e3 * reach.radius])
        values = self._along_axes({"slice": self.plane, "cylinder": "rz"}.get(self.kind, "xyz"), ends)
        if self.kind == "cylinder":
            values["phi"] = np.linspace(-180.0, 180.0, round(360.0 / TURN_deg) + 1)
            if self.phi_deg is not None:
                values["phi"] = values_of(self.phi_deg, "--phi", "deg", "-90:90:15")
        if self.kind != "slice":
            return space_layout(values)
        (third,) = set("xyz") - set(self.plane)
        if getattr(self, f"{third}_mm") is not None:
            raise InputError(
                f"--{third} cannot be combined with --plane {self.plane}, which holds it",
                code="A002",
                remedy=f"give --at MM for {third}",
            )
        # Of a horizontal slice half the height that the tool reaches, a round number.
        middle = 50.0 * round(0.5 * float(ends["z"].sum()) / 50.0) if third == "z" else 0.0
        return space_layout(values, {third: middle if self.at_mm is None else self.at_mm})

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, in words by name, as its files say it."""
        out = {
            "robot": given.robot.name,
            "model_hash": content_hash(given.description),
            "load": f"force along {vector_words(self.along)} (base axes)",
            "load_direction": vector_words(self.along),
            "pose": self.pose_words,
            "stiffness_from": "model",
            "links": given.model.link_kind,
            "load_path": given.model.load_path,
            "normal": vector_words(self.normal),
            "tool_on_flange": frame_words(self.frame(given.robot)),
            "not_looked_at": "collisions; the way from point to point",
        }
        return out | warned(given) | {f"at_{name}": f"{v:g} mm" for name, v in engine.grid.held.items()}

    def key(self, given: Arm) -> str:
        """SHA-256 of all that a block depends on."""
        asked = {f.name: getattr(self, f.name) for f in fields(self)}
        of = [__version__, content_hash(given.description), given.model.link_kind, given.model.load_path, asked]
        return hashlib.sha256(json.dumps(of, sort_keys=True, default=np.ndarray.tolist).encode()).hexdigest()

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

    def _layers(self, robot: Robot) -> Sequence[float] | None:
        name = default_sweep(robot)[1]
        if self.layers_deg is None:
            return None
        if name is None:
            raise InputError(
                "--layers",
                code="A004",
                value=str(tuple(self.layers_deg)),
                allowed=f"nothing: the map of {robot.name} has no layers",
                remedy="leave it out",
            )
        low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
        values = list(self.layers_deg)
        if not all(low <= v <= high for v in values) or len(set(values)) < len(values):
            raise InputError(
                "--layers",
                code="A004",
                value=",".join(f"{v:g}" for v in values),
                allowed=f"values of {name}, each once, from {low:g} to {high:g} deg",
                remedy="separate them by commas, as in -90,0,90",
            )
        return values

    def _along_axes(self, names: str, ends: Mapping[str, Array]) -> dict[str, Array]:
        """Values (mm) along axes: those given; else all in reach, in the finest step given or a round one."""
        asked = {name: getattr(self, f"{name}_mm") for name in names}
        given = {name: values_of(v, f"--{name}") for name, v in asked.items() if v is not None}
        steps = [float(v[1] - v[0]) for v in given.values() if len(v) > 1]
        longest = max(float(np.ptp(ends[name])) for name in names)
        step = self.step_mm or (min(steps) if steps else step_for(longest, ALONG[self.kind]))
        return {
            name: given[name] if name in given else range_for(float(ends[name][0]), float(ends[name][1]), step)
            for name in names
        }


def vector_words(vector: Vector) -> str:
    """A vector as files say it."""
    return " ".join(f"{v + 0.0:.6g}" for v in vector)


def table_of(normal: Vector = (0.0, 0.0, 1.0), relative_sd: Callable[[Array], Array] | None = None) -> tuple[Any, ...]:
    """All quantities that a map can have; with ``relative_sd``, poses -> (n,), the uncertainty of the stiffness."""
    return (*TABLE, *index_rows(normal), *(() if relative_sd is None else (uncertainty(relative_sd),)))


# What users may ask for, and what a pose may be chosen by.
SHORTS: tuple[str, ...] = (*(row.short for row in table_of()), "uncertainty")
MERITS: tuple[str, ...] = tuple(row.short for row in table_of() if row.merit is not None)


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
