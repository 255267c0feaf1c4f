"""What the Python functions give on bundled inputs, as frames, for ``recorded_figures.py``; and inputs that are made.

Each function gets the folder of the commands' results, of which only the programs and tables are used.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

import stiffarm as sa

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "docs/examples"
KR60, BRACKET = EXAMPLES / "kr60_posture", EXAMPLES / "kr60_bracket"
POSE = {"q2_deg": 5.0, "q3real_deg": 77.5}


def make_inputs(folder: Path) -> None:
    """Write a URDF with meshes, by the tests' own maker."""
    sys.path[:0] = [str(ROOT), str(ROOT / "tests/stiffarm")]
    from urdf_arms import Arm

    Arm().write(folder / "arm")


def _xr701() -> sa.Arm:
    return sa.load("xr701")


def _calibrated() -> sa.Calibration:
    return sa.calibrate(_xr701(), sa.bundled("xr701"), scheme="global")


def _surrogate() -> sa.Surrogate:
    return sa.fit(_calibrated().arm, runs=500, basis="polynomial", degree=3)


def _query(_: Path) -> pd.DataFrame:
    return _surrogate().query([POSE, {"q2_deg": 20.0, "q3real_deg": 60.0}]).to_frame()


def _slice(_: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    found = sa.map_slice(sa.load("kr60-3"), step_mm=300.0)
    return found.to_frame("quantities"), found.to_frame()


def _converted(_: Path) -> pd.DataFrame:
    file = EXAMPLES / "readings/dial_gauge.xlsx"
    return sa.convert_readings(file, arm=sa.load("kr60-3")).to_frame()


def _program(folder: Path) -> Sequence[pd.DataFrame]:
    arm, cell, out = sa.load("kr60-3"), BRACKET / "cell.toml", folder / "python-program"
    written = sa.post(arm, BRACKET / "bracket.mpf", out, cell=cell, gamma_deg=(-180.0, 180.0, 5.0))
    (neutral,) = out.glob("json/*.json")
    return written.to_frame(), sa.verify(arm, neutral, cell).to_frame()


def _place(_: Path) -> pd.DataFrame:
    wing = EXAMPLES / "tx200_wing"
    return sa.place(sa.load("tx200"), wing / "wing.cls", wing / "cell.toml", force_N=(0.0, 60.0, -80.0)).to_frame()


def _new(_: Path) -> pd.DataFrame:
    return sa.new_arm("own", mdh=EXAMPLES / "own_robot/dh.csv", payload_kg=60.0, mass_kg=650.0).to_frame()


def _positions(_: Path) -> pd.DataFrame:
    ur5 = EXAMPLES / "ur5"
    return sa.calibrate_positions(sa.load(ur5 / "ur5.toml"), ur5 / "grid.csv", holdout=ur5 / "random.csv").to_frame()


FUNCTIONS: dict[str, Callable[[Path], object]] = {
    "load": lambda _: _xr701().describe(),
    "simulate": lambda _: sa.simulate(_xr701(), pose=POSE, load={"fz_N": -650.0}).to_frame(),
    "replay": lambda _: sa.simulate(_xr701(), data=sa.bundled("xr701")).to_frame(),
    "read_readings": lambda _: sa.read_readings(sa.bundled("xr701"), _xr701()).to_frame(),
    "convert_readings": _converted,
    "calibrate": lambda _: _calibrated().to_frame(),
    "calibrate_positions": _positions,
    "diagnose": lambda _: sa.diagnose(_xr701(), sa.bundled("xr701"), loads_N=650.0, folds=0).to_frame(),
    "identify": lambda _: sa.identify(sa.load("tx200"), synthetic=True).to_frame(),
    "plan": lambda _: sa.plan(_xr701(), sa.bundled("xr701")).to_frame(),
    "rehearse": lambda _: sa.rehearse(sa.load("kr60-3"), hide="friction:j2", poses=9).to_frame(),
    "fit": lambda _: _surrogate().to_frame(),
    "query": _query,
    "index": lambda _: sa.index(_calibrated().arm, pose=POSE, force=(0.0, 0.0, -650.0)).to_frame(),
    "map_joints": lambda _: sa.map_joints(_calibrated().arm, points=5).to_frame(),
    "map_slice": _slice,
    "posture": lambda _: sa.posture(sa.load("kr60-3"), BRACKET / "bracket.cls", cell=BRACKET / "cell.toml").to_frame(),
    "place": _place,
    "post and verify": _program,
    "new_arm": _new,
}


def plain(found: object) -> object:
    """Frames as columns of numbers, arrays as lists; what is neither as its text."""
    if isinstance(found, pd.DataFrame):
        return {str(name): plain(found[name].to_numpy()) for name in found.columns}
    if isinstance(found, dict):
        return {str(key): plain(value) for key, value in found.items()}
    if isinstance(found, np.ndarray):
        return plain(found.tolist())
    if isinstance(found, list | tuple):
        return [plain(value) for value in found]
    return found if isinstance(found, bool | int | float) else str(found)
