"""A map over joint coordinates from a surrogate: the stiffness that it learned, and the model's own beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem import directional_stiffness
from fem.arm import Arm
from robots import InputError
from robots.arrays import Array
from robots.constants import DOWN, N_PER_M_TO_N_PER_MM
from stiffarm.commands.maps.request import MapRequest
from surrogate import Surrogate, default_sweep, load_surrogate
from surrogate.maps.blocks import Engine
from surrogate.maps.quantities import STIFFNESS_ARRAY, Kind, Poses, Quantity
from surrogate.model import predict_compliance


def read_surrogate_for_map(given: Arm, file: Path) -> Surrogate:
    """A surrogate that can stand for this robot in the 3-D map.

    Raises
    ------
    InputError
        Another robot's, of another load than the vertical one, or without a coordinate that the map moves.
    """
    learned = load_surrogate(file)
    refit = "fit one for this map (`stiffarm fit`)"
    if learned.robot != given.robot.name:
        raise InputError(
            f"surrogate {file} is of robot", code="A010", value=learned.robot, allowed=given.robot.name, remedy=refit
        )
    if not np.allclose(learned.load_direction, DOWN, rtol=0.0, atol=1e-9):
        raise InputError(
            f"surrogate {file}: load direction",
            code="A010",
            value=learned.load_direction,
            allowed="0, 0, -1",
            remedy=refit,
        )
    swept, layer = default_sweep(given.robot)
    held = [name for name in (*swept, layer) if name is not None and name not in learned.inputs]
    if held:
        raise InputError(
            f"surrogate {file} knows only one value of {', '.join(held)}, which the map moves",
            code="A010",
            remedy=refit,
        )
    return learned


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedRequest(MapRequest):
    """A map over joints with the stiffness (N/mm) by a surrogate under its load, and by the model beside it."""

    learned: Surrogate

    def rows(self, given: Arm) -> tuple[Quantity, ...]:
        """The two quantities."""
        columns = [given.robot.coordinate_index(name) for name in self.learned.inputs]

        def from_surrogate(p: Poses) -> list[Array]:
            return [N_PER_M_TO_N_PER_MM / predict_compliance(self.learned, p.q[:, columns])]

        def exact(p: Poses) -> list[Array]:
            return [N_PER_M_TO_N_PER_MM * directional_stiffness(p.model, p.q, p.direction)]

        return (
            Quantity("learned", (Kind(STIFFNESS_ARRAY, "N/mm", "stiffness along the load"),), from_surrogate),
            Quantity("model", (Kind("model_stiffness_N_per_mm", "N/mm", "stiffness by the model"),), exact),
        )

    def metadata(self, given: Arm, engine: Engine) -> dict[str, str]:
        """What the map is of, in words by name."""
        return super().metadata(given, engine) | {"stiffness_from": f"surrogate ({self.learned.basis})"}
