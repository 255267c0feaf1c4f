"""What the calibration tests share: models, the measured data, and readings made from known springs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pytest

from doe import Campaign, Measurements, bundled_campaign, bundled_data, read_measurements, select_loads
from fem import ArmModel, build_model, deflection
from robots import Robot, load_description, load_robot

Arm = Callable[..., ArmModel]
Readings = Callable[..., Measurements]


@cache
def _arm(robot: str, links: str, load_path: str) -> ArmModel:
    return build_model(load_description(robot), links, load_path)  # type: ignore[arg-type]


def _readings(
    model: ArmModel,
    springs: Mapping[str, float],
    q: np.ndarray,
    wrench: np.ndarray,
    components: str = "xyz",
    pose: tuple[str, ...] | None = None,
    noise_m: np.ndarray | float = 0.0,
    point: tuple[float, float, float] | None = None,
) -> Measurements:
    """Make readings of a model with known springs; components that are not named are not read.

    ``point`` (m, flange frame) is where is loaded and read, instead of the model's tool point.
    """
    n = len(q)
    where = None if point is None else np.array(point)
    moved = deflection(model.with_springs(springs), q, wrench, where) + np.asarray(noise_m)
    read = np.isin(np.arange(6), ["xyz".index(c) for c in components])
    unknown = np.full(n, np.nan)
    return Measurements(
        source="made up",
        sha256="0" * 64,
        q=q,
        wrench=np.broadcast_to(wrench, (n, 6)).copy(),
        displacement=np.where(read, moved, np.nan),
        sigma=unknown,
        step=unknown,
        point=np.tile(np.full(3, np.nan) if where is None else where, (n, 1)),
        pose=pose or tuple(f"P{i + 1}" for i in range(n)),
        repeat=(None,) * n,
        phase=(None,) * n,
        row_numbers=tuple(range(2, n + 2)),
        extra={},
        notes=(),
    )


@pytest.fixture(scope="session")
def arm() -> Arm:
    """Build a model: ``arm(robot="xr701", links="beam", load_path="parallelogram")``."""

    def build(robot: str = "xr701", links: str = "beam", load_path: str | None = None) -> ArmModel:
        return _arm(robot, links, load_path or ("parallelogram" if robot == "xr701" else "serial"))

    return build


@pytest.fixture(scope="session")
def readings() -> Readings:
    """Make readings from a model: ``readings(model, springs, q, wrench, components, pose, noise_m, point)``."""
    return _readings


@pytest.fixture(scope="session")
def xr701() -> Robot:
    return load_robot("xr701")


@pytest.fixture(scope="session")
def scheme() -> Campaign:
    found = bundled_campaign("xr701")
    assert found is not None
    return found


@pytest.fixture(scope="session")
def measured(xr701: Robot, scheme: Campaign) -> Measurements:
    """The nine measured poses at 650 N."""
    data = select_loads(read_measurements(bundled_data("xr701"), xr701), scheme.loads_N)
    assert data.n == 9
    return data


@pytest.fixture(scope="session")
def random_poses() -> Callable[[Robot, int, np.random.Generator], np.ndarray]:
    """Draw n poses inside a robot's limits."""

    def draw(robot: Robot, n: int, rng: np.random.Generator) -> np.ndarray:
        found: list[np.ndarray] = []
        while len(found) < n:
            q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], size=(4 * n, robot.dof))
            found.extend(q[robot.reachable(q)])
        return np.array(found[:n])

    return draw
