"""Tables, arms and numbers set free for the round trip: calibrate, write, read back, simulate on the same table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign
from doe.estimation.problem import problem
from doe.tables.loaded import history_of, simulate
from fem.arm import Arm
from fem.effects import LOAD_PATH, PlacedEffect, build_plain, catalogue, described_effects, with_effects
from fem.elements.walls import wall_flexibilities
from fem.free.parameters import Parameter
from robots import ModelDescription, Robot, load_description, save_description
from robots.arrays import Array
from robots.robot import robot_from
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.step import Calibrated, Request
from stiffarm.session import inputs

Points = Literal["tool", "own", "mixed"]

SPRINGS = {"j1": 3e6, "j2": 1.4e6, "j3": 8e5, "j4": 6e5, "j5": 5e5, "j6": 4e5}
NOISE_M = 2e-6


def quantity(value: Any, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit, "source": "assumed"}


def arm(effects: Sequence[str] = (), *, path: str = "parallelogram", **tables: Any) -> ModelDescription:
    """The XR701 with a spring at every joint, effects of plausible size, and further tables of a model file."""
    data = load_description("xr701").model_dump(by_alias=True)
    for joint in data["joint"]:
        joint["stiffness"] = quantity(SPRINGS[joint["name"]], "N m/rad")
    out = ModelDescription.model_validate({**data, "load_path": path, **tables})
    if not effects:
        return out
    known = catalogue(build_plain(out), out)
    return with_effects(out, [_plausible(known[code]) for code in effects], "made up")


def _plausible(effect: Any) -> PlacedEffect:
    values = [p.grid[len(p.grid) // 2] if p.role == "shape" else float(np.mean(p.size)) for p in effect.parameters]
    return PlacedEffect(effect, np.array(values))


def table(
    robot: Robot, *, points: Points = "mixed", only_z: bool = False, cycles: bool = True, poses: int = 5
) -> Measurements:
    """Loads in two directions, with moments, at some poses; nothing read yet (zeros).

    ``cycles``: on the way up and down, in the order of a clock; every fifth reading lacks its Z.
    """
    rng = np.random.default_rng(0)
    q = rng.uniform(*robot.limits.T, (4000, robot.dof))
    q = q[robot.reachable(q)][:poses]
    way = np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.6, -0.8, 0.0, 0.05, 0.1]])
    course = (
        [(150.0, "loading"), (650.0, "loading"), (375.0, "unloading")] if cycles else [(150.0, None), (650.0, None)]
    )
    rows = [(k, w, load, phase) for k in range(poses) for w in way for load, phase in course]
    n = len(rows)
    point = np.full((n, 3), np.nan)
    own = np.arange(n) % 4 < 2 if points == "mixed" else np.full(n, points == "own")
    point[own] = np.column_stack([np.full(n, 0.1), 0.05 * (np.array([r[0] for r in rows]) % 3), np.full(n, 0.2)])[own]
    d = np.zeros((n, 6))
    d[:, 3:] = np.nan
    d[::5, 2] = np.nan if cycles else 0.0
    if only_z:
        d[:, :2], d[:, 2] = np.nan, 0.0
    return Measurements(
        "table.csv",
        "0" * 64,
        q[[r[0] for r in rows]],
        np.array([load * w for _, w, load, _ in rows]),
        d,
        point,
        np.full(n, np.nan),
        tuple(f"P{r[0]}" for r in rows),
        (None,) * n,
        tuple(r[3] for r in rows),
        np.arange(n, dtype=float) if cycles else np.full(n, np.nan),
        tuple(range(2, n + 2)),
        {},
        (),
    )


def filled(data: Measurements, d: Array) -> Measurements:
    """The table with displacements (n, 6) and some noise where it has readings."""
    noise = np.random.default_rng(1).normal(0.0, NOISE_M, d.shape)
    return replace(data, displacement=np.where(data.used, d + noise, np.nan))


@dataclass(frozen=True)
class Case:
    """Numbers set free together, of which arm, read how; ``laws`` as a calibration file has them."""

    names: tuple[str, ...]
    description: ModelDescription = field(default_factory=arm)
    laws: tuple[dict[str, Any], ...] = ()
    points: Points = "mixed"
    only_z: bool = False
    cycles: bool = True
    load_path: str | None = None
    loads: tuple[float, ...] = ()
    stages: tuple[dict[str, Any], ...] = ()

    @property
    def campaign(self) -> Campaign:
        return Campaign.model_validate(
            {
                "schema": "stiffarm-calibration/1",
                "robot": self.description.name,
                "title": "round trip",
                "parameter": [{"name": name} for name in self.names],
                "law": list(self.laws),
                "stage": list(self.stages),
            }
        )


@dataclass(frozen=True)
class Trip:
    """A calibration, its table, and what the file that it wrote makes of the same table (m,), read minus simulated."""

    found: Calibrated
    data: Measurements
    simulated: Array
    back: Arm
    start: Array


def travelled(case: Case, folder: Path) -> Trip:
    """Make a table with the case's numbers off the model's, calibrate on it, write, read back, simulate on it."""
    save_description(case.description, folder / "given.toml")
    given = inputs.read_model(str(folder / "given.toml"), None, case.load_path)
    data = table(given.robot, points=case.points, only_z=case.only_z, cycles=case.cycles)
    data, start = off_nominal(given, data, case.campaign)
    found = calibrating.calibrate(given, data, Request(case.campaign, loads=case.loads))
    save_description(found.description, folder / "model.toml")
    back = inputs.read_model(str(folder / "model.toml"), None, case.load_path)
    return Trip(found, data, residual(back, data, found), back, start)


def residual(back: Arm, data: Measurements, found: Calibrated) -> Array:
    """Read minus simulated (m,) of the readings that a calibration used, on the whole table."""
    error = data.displacement - simulate(back.model, data, back.effects, history_of(data))
    used = error[np.isin(data.row_numbers, found.data.row_numbers)]
    return np.asarray(used[found.found.overall.row, found.found.overall.component])


def off_nominal(given: Arm, data: Measurements, campaign: Campaign) -> tuple[Measurements, Array]:
    """Readings of the arm with the campaign's numbers off the model's, and the variables (p,) that it starts at."""
    plain = build_plain(given.description, given.model.link_kind, given.model.load_path)
    placed = described_effects(given.description, plain)
    effects = tuple(e for e in placed if e.effect.code != LOAD_PATH)
    parameters, laws = campaign.free(plain, None, effects)
    walls = wall_flexibilities(given.description, plain, parameters)
    free = problem(plain, data, parameters, laws, walls, effects).free
    u = np.array([_away(p, float(v)) for p, v in zip(parameters, free.start, strict=True)])
    return filled(data, free.displacement(u)), free.start


def _away(p: Parameter, start: float) -> float:
    low, high = p.inner_bounds
    if p.kind.name == "coupling":
        # Below the geometric mean of its two entries on the diagonal, or the part would give energy back.
        return 5e-8
    if p.scale == "compliance":
        # What is rigid in the model is given some compliance.
        soft = {"modulus": 1.6 * start, "effect": 1.6 * start}.get(
            p.kind.name, start + (2e-8 if p.unit == "N/m" else 3e-7)
        )
        return min(soft, high)
    if p.is_logarithm:
        return start + 0.2
    return min(start + 0.03 * (high - low), high)


def law(kind: str, **more: Any) -> dict[str, Any]:
    return {"kind": kind, **more}


LOAD = {
    "offset": quantity((0.05, 0.02, -0.03), "m"),
    "tilt": quantity((3.0, -4.0, 2.0), "deg"),
    "point": quantity((0.01, 0.0, 0.02), "m"),
}
FOURIER = law("fourier", joint="j2", input="q2_deg", order=1)
POLYNOMIAL = law("polynomial", joint="j4", inputs=["q4_deg", "q5_deg"], degree=1)
TABLE = law("table", joint="j3", input=robot_from(arm()).coordinates[2], nodes_deg=[-60.0, 0.0, 60.0, 200.0])

# At least one case for every kind of number; the first of each runs every day.
CASES: dict[str, tuple[Case, ...]] = {
    "stiffness": (
        Case(("j2.stiffness", "j4.rx", "base.tz", "tool.tx", "bar.stiffness")),
        Case(("j2.stiffness", "j3.stiffness"), points="tool", only_z=True, cycles=False),
        Case(("base.rx",), load_path="serial"),
        Case(("j2.stiffness", "bar.stiffness"), arm(path="serial"), load_path="parallelogram"),
        Case(("j2.stiffness",), arm(("load-path",))),
    ),
    "coupling": (
        Case(("base.rx", "base.ry", "base.rx-ry")),
        Case(("j4.rx", "j4.ry", "j4.rx-ry")),
        Case(("tool.rx", "tool.ry", "tool.rx-ry")),
        Case(("j4.stiffness", "j4.rx", "j4.rx-rz")),
    ),
    "modulus": (Case(("upper-arm.modulus",)), Case(("forearm.modulus", "j2.stiffness"), load_path="serial")),
    "wall": (Case(("upper-arm.wall",)), Case(("forearm.wall", "j3.stiffness"), load_path="serial")),
    "zero": (
        Case(("j2.zero", "j3.zero"), laws=(FOURIER,)),
        Case(("j4.zero",), laws=(POLYNOMIAL,)),
        Case(("j3.zero",), laws=(TABLE,), load_path="serial"),
        Case(("j2.zero", "load.x"), arm(load=LOAD)),
        Case(("j2.zero",), arm(("angle-dependent-stiffness:j2",))),
        Case(("j2.zero",), arm(("gear-ripple:j2", "joint-tilt:j3"))),
        Case(("j2.zero", "j3.zero"), arm(("backlash:j3", "joint-zero-offset:j2")), points="own"),
    ),
    "load": (
        Case(("load.x", "load.z"), arm(load=LOAD)),
        Case(("load.x", "load.y", "load.z", "load.tilt_x", "load.tilt_y"), arm(load=LOAD)),
        Case(("load.x",), arm(("load-point-offset", "load-misalignment"), load=LOAD), points="own"),
    ),
    "tilt": (
        Case(("load.tilt_x",), arm(load=LOAD)),
        Case(("load.tilt_x", "load.tilt_y"), only_z=True),
        Case(("load.tilt_z",), arm(load=LOAD)),
        Case(("load.tilt_y",), arm(("payload",), load=LOAD), load_path="serial"),
    ),
    "frame": (
        Case(("frame.rx", "frame.rz")),
        Case(("frame.ry", "load.x"), arm(load=LOAD), points="own"),
        Case(("frame.rz", "j2.stiffness"), arm(("turned-frame",))),
    ),
    "point": (
        Case(("point.x", "point.z", "j2.stiffness"), points="own"),
        Case(("point.x",), points="tool"),
        Case(("point.x", "point.y"), points="mixed"),
        Case(("point.x", "load.z"), arm(load=LOAD), points="mixed"),
        Case(("point.z",), arm(("backlash:j3", "tool-compliance"), load=LOAD), points="own"),
    ),
    "law": (
        Case((), laws=(TABLE,)),
        Case((), laws=(FOURIER,)),
        Case(("j2.stiffness",), laws=(POLYNOMIAL,), load_path="serial"),
    ),
    "effect": (
        Case(("drift.x", "gauge-zero.z", "gauge-scale.share"), arm(("drift", "gauge-zero", "gauge-scale"))),
        Case(("drift.z",), arm(("drift",)), loads=(150.0,)),
    ),
}
STAGED = Case(
    ("j2.stiffness", "load.x", "load.tilt_y", "point.x"),
    arm(load=LOAD),
    stages=(
        {"name": "spring", "parameters": ["j2.stiffness"]},
        {"name": "load", "parameters": ["load.x"], "poses": ["P0", "P1", "P2", "P3"]},
        {"name": "tilt", "parameters": ["load.tilt_y"], "loads_N": [650.0]},
        {"name": "point", "parameters": ["point.x"]},
    ),
)
