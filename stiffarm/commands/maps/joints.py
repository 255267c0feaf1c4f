"""A map over joint coordinates as asked for, also with the stiffness by a surrogate and by the model side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from fem import directional_stiffness
from fem.arm import Arm
from robots import InputError, Robot
from robots.arrays import Array
from robots.constants import DOWN, N_PER_M_TO_N_PER_MM
from stiffarm.commands.maps.request import NUMBERS, ArmMapRequest
from stiffarm.commands.query.command import Surrogate
from stiffarm.request import Kind, option
from surrogate import Surrogate as Learned
from surrogate import load_surrogate
from surrogate.maps.blocks import Engine
from surrogate.maps.data import Layout, LayoutKind
from surrogate.maps.layouts import default_sweep, sweep_layout
from surrogate.maps.quantities import STIFFNESS_ARRAY, Poses, Quantity
from surrogate.maps.quantities import Kind as Column
from surrogate.model import predict_compliance

SURROGATE: Final = Kind(
    "FILE", lambda text, name: Path(text), lambda value, name: Path(value) if isinstance(value, str) else value
)


@dataclass(frozen=True, kw_only=True, eq=False)
class JointsRequest(ArmMapRequest):
    """Map the arm over its joint angles: three coordinates swept over their limits, a fourth in layers.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.map_joints(sa.load("xr701"), points=3).data.layout.kind
    'joints'
    """

    kind: ClassVar[LayoutKind] = "joints"

    surrogate: Surrogate | Path | str | None = option(
        "Take the stiffness from this surrogate; the model's own is mapped as well.", SURROGATE
    )
    points: int = option("Number of values of each coordinate that is swept.", default=21, least=2, most=1000)
    layers_deg: Sequence[float] | None = option(
        "Values of the fourth coordinate, which turns the arm out of its plane, in deg, separated by commas.",
        NUMBERS,
        spelled=("--layers",),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.surrogate is None:
            return
        defaults: dict[str, Any] = {f.name: f.default for f in fields(self)}
        for name in ("direction", "values", "tool", "normal", "format", "dask", "work", "at_load", "html"):
            given, default = getattr(self, name), defaults[name]
            if given is not None and given is not False and not np.array_equal(given, default):
                raise InputError(
                    f"--{name.replace('_', '-')} cannot be combined with --surrogate",
                    code="A002",
                    remedy="leave one of them out",
                )

    @cached_property
    def learned(self) -> Learned | None:
        """The surrogate that the stiffness is taken from."""
        own = self.surrogate
        return None if own is None else load_surrogate(Path(own)) if isinstance(own, str | Path) else own.learned

    def grid(self, robot: Robot) -> Layout:
        """The map's points."""
        return sweep_layout(robot, self.points, self._layers(robot))

    def rows(self, given: Arm) -> tuple[Quantity, ...]:
        """The quantities of the map; with a surrogate the stiffness (N/mm) by it, and by the model."""
        learned = self.learned
        if learned is None:
            return super().rows(given)
        _require_fit(learned, given.robot)
        columns = [given.robot.coordinate_index(name) for name in learned.inputs]

        def from_surrogate(p: Poses) -> list[Array]:
            return [N_PER_M_TO_N_PER_MM / predict_compliance(learned, p.q[:, columns])]

        def exact(p: Poses) -> list[Array]:
            return [N_PER_M_TO_N_PER_MM * directional_stiffness(p.model, p.q, p.direction)]

        return (
            Quantity("learned", (Column(STIFFNESS_ARRAY, "N/mm", "stiffness along the load"),), from_surrogate),
            Quantity("model", (Column("model_stiffness_N_per_mm", "N/mm", "stiffness by the model"),), exact),
        )

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, in words by name."""
        own = {} if self.learned is None else {"stiffness_from": f"surrogate ({self.learned.basis})"}
        return super().metadata(given, engine) | own

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


def _require_fit(learned: Learned, robot: Robot) -> None:
    """Refuse another robot's surrogate, one of another load than the vertical one, or that lacks what the map moves."""
    swept, layer = default_sweep(robot)
    held = [name for name in (*swept, layer) if name is not None and name not in learned.inputs]
    wrong: tuple[str, Any, str] | None = None
    if learned.robot != robot.name:
        wrong = "is of robot", learned.robot, robot.name
    elif not np.allclose(learned.load_direction, DOWN, rtol=0.0, atol=1e-9):
        wrong = "has the load direction", learned.load_direction, "0, 0, -1"
    elif held:
        wrong = "knows only one value of", ", ".join(held), "all that the map moves"
    if wrong is not None:
        remedy = "fit one for this map (`stiffarm fit`)"
        raise InputError(f"surrogate {wrong[0]}", code="A010", value=wrong[1], allowed=wrong[2], remedy=remedy)
