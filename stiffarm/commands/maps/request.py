"""A map as asked for, as plain data: what a cluster's workers are sent, what a work folder is known by."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from fem import LINK_KINDS, ArmModel
from fem.arm import Arm
from machining import Objective
from machining.stiffness.distribution import EveryGamma
from machining.stiffness.map_rows import index_rows
from robots import InputError, ModelDescription, content_hash
from robots.arrays import Array
from robots.files.reading import parse_json
from robots.library.models import parse_description, to_toml
from robots.robot import middle_pose
from stiffarm import __version__
from stiffarm.session.stated import Given, at_load, propagated
from surrogate.maps import candidates
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import REFUSED
from surrogate.maps.data import Axis, Layout
from surrogate.maps.poses import BestGamma, Extreme, PoseRule, away_from_singular, last_joint_is_free
from surrogate.maps.quantities import TABLE, Quantities, Quantity, named, uncertainty
from surrogate.maps.store import Column

FORM = "stiffarm-map/1"
_CHECKSUM = "content_sha256"
_REMEDY = "install the same version of stiffarm everywhere"


@dataclass(frozen=True)
class MapRequest:
    """Everything that a block of a map depends on.

    ``grid``: see :func:`grid_table`; ``pose``: rule and its figures, None for a joint layout; ``tool`` (4, 4) rows, m,
    on the flange; ``direction``, ``normal``: base axes; ``wanted``: short names of quantities; ``merit``: what a pose
    is chosen by; ``block``: points in one; ``at_load``: N, at which an arm with effects is mapped, None: as usual.
    """

    model: str
    model_hash: str
    links: str
    load_path: str | None
    grid: dict[str, Any]
    pose: dict[str, Any] | None
    tool: list[list[float]]
    direction: list[float]
    normal: list[float]
    wanted: list[str]
    shares: bool
    merit: str
    block: int
    seed: int
    at_load: float | None = None
    version: str = __version__
    form: str = FORM

    @property
    def text(self) -> str:
        """As JSON with its own checksum, always the same for the same map."""
        return json.dumps({**asdict(self), _CHECKSUM: self.key}, sort_keys=True, allow_nan=False)

    @property
    def key(self) -> str:
        """SHA-256 of all that is asked."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True, allow_nan=False).encode()).hexdigest()

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Read :attr:`text`.

        Raises
        ------
        InputError
            Of another form or version of stiffarm, or not the text that was sent.
        """
        data = parse_json(text, "map request", remedy=_REMEDY)
        for key, mine in (("form", FORM), ("version", __version__)):
            found = data.get(key) if isinstance(data, dict) else None
            if found != mine:
                raise InputError(f"map request: {key}", code="F007", value=found, allowed=mine, remedy=_REMEDY)
        checksum = data.pop(_CHECKSUM, None)
        # Nobody writes requests by hand: what is whole has every key, and of its type.
        if hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest() != checksum:
            raise InputError("map request: its checksum does not match", code="F007", remedy="make the map again")
        return cls(**data)


def model_text(given: Arm) -> tuple[str, str]:
    """The model as TOML text, and its hash."""
    return to_toml(given.description), content_hash(given.description)


def grid_table(grid: Layout) -> dict[str, Any]:
    """A grid as plain data."""
    axes = [[axis.name, axis.unit, axis.values.tolist()] for axis in grid.axes]
    frame = None if grid.frame is None else grid.frame.tolist()
    return {"kind": grid.kind, "axes": axes, "layers": grid.layers, "held": dict(grid.held), "frame": frame}


def grid_from(table: Mapping[str, Any]) -> Layout:
    """Read :func:`grid_table`."""
    axes = tuple(Axis(name, unit, np.array(values)) for name, unit, values in table["axes"])
    frame = None if table["frame"] is None else np.array(table["frame"])
    return Layout(table["kind"], axes, table["layers"], dict(table["held"]), frame)


def rule_from(table: Mapping[str, Any]) -> PoseRule:
    """The rule of a request: ``axis`` and ``gammas`` (rad), or ``rule`` 'stiffest' or 'softest'."""
    if "gammas" in table:
        return BestGamma(np.array(table["axis"]), np.array(table["gammas"]))
    return Extreme(table["rule"])


def every_gamma(asked: MapRequest, model: ArmModel) -> EveryGamma | None:
    """The rule of a request that tells an ``objective`` at every one of its ``gammas``; None for other requests."""
    table, frame = asked.pose or {}, asked.grid["frame"]
    if "objective" not in table:
        return None
    quantity, force, aim = table["objective"]
    objective = Objective(quantity, None if force is None else np.array(force), aim)
    figures = (table["gammas"], asked.tool, frame, asked.normal, table["axis"])
    return EveryGamma(model, objective, *map(np.array, figures))


def table_of(
    normal: ArrayLike = (0.0, 0.0, 1.0), relative_sd: Callable[[Array], Array] | None = None
) -> tuple[Quantity, ...]:
    """All quantities that a map can have; with ``relative_sd``, poses -> (n,), the uncertainty of the stiffness."""
    return (*TABLE, *index_rows(normal), *(() if relative_sd is None else (uncertainty(relative_sd),)))


# What users may ask for, and what a pose may be chosen by.
SHORTS: tuple[str, ...] = (*(row.short for row in table_of()), "uncertainty")
MERITS: tuple[str, ...] = tuple(row.short for row in table_of() if row.merit is not None)


def stated(given: Given, asked: MapRequest) -> Given:
    """The arm at the load that a map is asked for."""
    return at_load(given, asked.at_load, asked.direction, np.array(asked.tool)[:3, 3])


def engine_of(asked: MapRequest, description: ModelDescription, model: ArmModel) -> Engine:
    """What evaluates a request. Errors as :class:`Quantities`."""
    tool, direction = np.array(asked.tool), np.array(asked.direction)
    sd = None
    if "uncertainty" in asked.wanted:
        sd = uncertainty_of(description, model, direction, tool[:3, 3])
    table = table_of(asked.normal, sd)
    quantities = Quantities(model, direction, named(table, asked.wanted), shares=asked.shares, point=tool[:3, 3])
    grid = grid_from(asked.grid)
    if asked.pose is None:
        return Engine(grid, quantities, seed=asked.seed)
    merit, rule = quantities.merit(named(table, [asked.merit])[0]), every_gamma(asked, model)
    if rule is not None:
        told = {"by_gamma": Column("<f8", (len(rule.gamma),))}
        return Engine(grid, quantities, rule, candidates.Arm(model.robot, tool, merit), asked.seed, told)
    free = last_joint_is_free(model.robot, tool, lambda q: quantities.poses(q).translational)
    chosen_by = merit if asked.pose.get("rule") == "softest" else away_from_singular(model.robot, tool[:3, 3], merit)
    arm = candidates.Arm(model.robot, tool, chosen_by, free)
    return Engine(grid, quantities, rule_from(asked.pose), arm, asked.seed)


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


def evaluate(text: str, number: int) -> dict[str, Any]:
    """One block of a request, on a worker; what is wrong with the request comes back as words."""
    try:
        asked, engine = _engine(text)
        start = number * asked.block
        return dict(engine.block(slice(start, min(start + asked.block, engine.grid.n))))
    except InputError as error:
        return {REFUSED: str(error)}


@lru_cache(maxsize=2)
def _engine(text: str) -> tuple[MapRequest, Engine]:
    asked = MapRequest.from_text(text)
    description = parse_description(asked.model, "the model of the map")
    found = content_hash(description)
    if found != asked.model_hash:
        raise InputError(
            "model of the map: hash",
            code="A010",
            value=found[:12],
            allowed=asked.model_hash[:12],
            remedy="install the same version of stiffarm everywhere",
        )
    kind = next(kind for kind in LINK_KINDS if kind == asked.links)
    path = next((path for path in ("parallelogram", "serial") if path == asked.load_path), None)
    given = stated(Arm.of(description, kind, path), asked)
    return asked, engine_of(asked, description, given.model)
