"""Made-up arms of all sizes with springs within three times their class, and readings of them, right or mistyped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from doe import Measurements
from fem import ArmModel, build_model, deflection
from robots import ModelDescription
from robots.arm_class import arm_class
from robots.robot import Robot, robot_from


def _value(value: object, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": "assumed"}


@dataclass(frozen=True)
class MadeUp:
    """An arm, its model as the user's file has it (no springs), and right readings."""

    description: ModelDescription
    model: ArmModel
    data: Measurements


def made_up(rng: np.random.Generator, *, edge: bool = False) -> MadeUp:
    """An arm of random size, lengths, twists and springs; ``edge``: all springs at one end of what is allowed."""
    description = _described(rng, reach=float(np.exp(rng.uniform(np.log(0.5), np.log(3.5)))))
    robot = robot_from(description)
    model = build_model(description, "beam" if description.link else "rigid")
    low, high = arm_class(description, robot).allowed
    at = rng.integers(0, 2) if edge else rng.uniform(0.0, 1.0, robot.dof)
    springs = np.exp(np.log(low) + at * np.log(high / low))
    true = model.with_springs(dict(zip(robot.joint_names, springs.tolist(), strict=True)))
    return MadeUp(description, model, _readings(rng, robot, true))


def _described(rng: np.random.Generator, reach: float) -> ModelDescription:
    """DH rows as arms have them (upper arm and forearm long, the rest short), or twists by chance."""
    dof = int(rng.choice([4, 5, 6, 6, 6, 6, 7]))
    usual = rng.uniform() < 0.6
    share = np.array([0.0, 0.12, 0.38, 0.05, 0.38, 0.05, 0.02])[:dof] * rng.uniform(0.5, 1.5, dof)
    along_x, along_z = np.array([[1, 1, 1, 1, 0, 0, 0], [1, 0, 0, 0, 1, 1, 1]])[:, :dof]
    a, d = (share * along_x, share * along_z) if usual else (share, np.zeros(dof))
    alpha = np.array([0.0, -90.0, 0.0, -90.0, 90.0, -90.0, 90.0])[:dof]
    if not usual:
        alpha[1:] = rng.choice([0.0, 90.0, -90.0, 30.0], dof - 1, p=[0.25, 0.35, 0.35, 0.05])
        if not alpha[1:].any():
            alpha[1] = 90.0
    scale = reach / float(np.abs(a[1:]).sum() + np.abs(d[1:]).sum() + 0.1)
    joints = [
        {
            "name": f"j{k + 1}",
            "coordinate": f"q{k + 1}_deg",
            "limits": _value([-170, 170], "deg"),
            "dh": {
                "alpha": _value(float(alpha[k]), "deg"),
                "a": _value(float(a[k] * scale), "m"),
                "d": _value(float(d[k] * scale), "m"),
            },
        }
        for k in range(dof)
    ]
    plain: dict[str, object] = {
        "schema": "stiffarm-model/1",
        "name": "made-up",
        "title": "made up",
        "sources": {},
        "joint": joints,
        "flange": {"xyz": _value([0, 0, 0.1 * scale], "m")},
        "materials": {
            "steel": {
                "youngs_modulus": _value(206, "GPa"),
                "poissons_ratio": _value(0.3, "1"),
                "density": _value(7850, "kg/m^3"),
            }
        },
    }
    load = 220.0 * reach**3.5 / (9.81 * reach) * float(np.exp(rng.normal(0.0, 0.5)))
    ratio = float(rng.uniform(0.05, 0.25))
    mass = load / (ratio + 0.15)
    said = rng.uniform(size=2) < 0.75
    plain |= {"mass": _value(mass, "kg")} if said[0] else {}
    plain |= {"payload": _value(ratio * mass, "kg")} if said[1] else {}
    if rng.uniform() < 0.5:
        width = 0.14 * scale
        box = {"kind": "box", "width": _value(width, "m"), "height": _value(width, "m"), "wall": _value(5, "mm")}
        robot = robot_from(ModelDescription.model_validate(plain))
        plain["link"] = [
            {"name": f"link{k}", "body": f"j{k}", "material": "steel", "section": box, "beam_up": _across(robot, k)}
            for k in (2, 3)
            if k < dof and np.linalg.norm(robot.T_pre[k][:3, 3]) > 0.05
        ]
    return ModelDescription.model_validate(plain)


def _across(robot: Robot, body: int) -> list[float]:
    """A direction across the link."""
    along = np.abs(robot.T_pre[body][:3, 3])
    return [float(v) for v in np.eye(3)[int(np.argmin(along))]]


def _readings(rng: np.random.Generator, robot: Robot, true: ArmModel) -> Measurements:
    """Few or many set-ups, one to three loads each; one or all components; noise of the reading and of the set-up."""
    setups = int(rng.choice([1, 2, 4, 9, 16, 30]))
    loads = np.sort(rng.choice([0.2, 0.5, 1.0], int(rng.integers(1, 4)), replace=False))
    span = np.radians(rng.choice([10.0, 60.0, 160.0]))
    middle = rng.uniform(-1.0, 1.0, robot.dof)
    q = np.clip(middle + rng.uniform(-span, span, (setups, robot.dof)), -2.9, 2.9)
    if rng.uniform() < 0.2:
        q[:] = q[0]
        q[:, -2:] = rng.uniform(-1.5, 1.5, (setups, 2))  # readings in which only the wrist turns
    kind = rng.choice(["down", "sideways", "any", "moment"], p=[0.5, 0.2, 0.25, 0.05])
    direction = np.zeros((setups, 6))
    direction[:, 2] = -1.0
    if kind == "sideways":
        direction[:, :3] = np.array([1.0, 0.0, 0.0]) if rng.uniform() < 0.5 else np.array([0.0, 1.0, 0.0])
    elif kind == "any":
        v = rng.normal(size=(setups, 3))
        direction[:, :3] = v / np.linalg.norm(v, axis=1, keepdims=True)
    elif kind == "moment":
        direction[:, 3:] = rng.normal(size=(setups, 3))
    q, wrench = np.repeat(q, len(loads), axis=0), np.repeat(direction, len(loads), axis=0)
    wrench *= np.tile(loads, setups)[:, None] * 10.0 ** rng.uniform(1.0, 3.0)
    d = deflection(true, q, wrench)
    noise = rng.uniform(0.0, 0.2)
    own, common = (noise, 0.0) if rng.uniform() < 0.7 else (0.5 * noise, 0.85 * noise)
    d *= 1.0 + own * rng.normal(size=d.shape) + np.repeat(common * rng.normal(size=(setups, 1)), len(loads), axis=0)
    read = np.zeros(6, dtype=np.bool_)
    if kind == "any" or rng.uniform() < 0.3:
        read[:3] = True
    else:
        read[int(np.argmax(np.abs(direction[0, :3])))] = True
    if rng.uniform() < 0.15:
        read[3:] = True
    d[:, ~read] = np.nan
    n = len(q)
    return Measurements(
        "made-up.csv",
        "0" * 64,
        q,
        wrench,
        d,
        np.full((n, 3), np.nan),
        np.full(n, np.nan),
        tuple(f"P{k // len(loads)}" for k in range(n)),
        (None,) * n,
        (None,) * n,
        np.full(n, np.nan),
        tuple(range(2, n + 2)),
        {},
        (),
    )


def scaled(data: Measurements, *, deflections: float = 1.0, loads: float = 1.0, angles: float = 1.0) -> Measurements:
    """The table with numbers as another unit has them: each column so many times as large."""
    factors = np.array([deflections] * 3 + [1.0] * 3)
    return replace(data, displacement=data.displacement * factors, wrench=data.wrench * loads, q=data.q * angles)


MISTYPED: dict[str, Callable[[Measurements], Measurements]] = {
    "micrometres": lambda m: scaled(m, deflections=1e3),
    "1/100 mm": lambda m: scaled(m, deflections=1e2),
    "1/1000 inch": lambda m: scaled(m, deflections=1e3 / 25.4),
    "cm": lambda m: scaled(m, deflections=0.1),
    "inches": lambda m: scaled(m, deflections=1.0 / 25.4),
    "metres": lambda m: scaled(m, deflections=1e-3),
    "lbf": lambda m: scaled(m, loads=1.0 / 4.4482216),
    "kgf": lambda m: scaled(m, loads=1.0 / 9.80665),
    "kN": lambda m: scaled(m, loads=1e-3),
    "radians": lambda m: scaled(m, angles=np.pi / 180.0),
    "grads": lambda m: scaled(m, angles=10.0 / 9.0),
}
