"""Every figure that commands and Python functions give on bundled inputs, recorded, so that "unchanged" can be shown.

``python benchmarks/recorded_figures.py --write figures.json`` runs all commands and keeps the figures of their JSON,
then all Python functions and keeps those of their frames; ``--against figures.json`` runs them again and names each
that differs by more than ``--relative``. Long columns are kept as their count, extremes, sum and sum of squares. Times
and hashes are left out. ``--renamed table.csv`` names keys that have another name since (columns ``before`` and
``now``, each a whole part of a key, as ``left_out`` in ``variants.left_out[3]``).
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    gamma = (-180.0, 180.0, 5.0)
    written = sa.post(arm, BRACKET / "bracket.mpf", cell=cell, gamma=gamma, tolerance_um=100.0)
    (neutral,) = written.save(out).glob("json/*.json")
    return written.to_frame(), sa.verify(arm, neutral, cell=cell).to_frame()


def _place(_: Path) -> pd.DataFrame:
    wing = EXAMPLES / "tx200_wing"
    force = (0.0, 60.0, -80.0)
    return sa.place(sa.load("tx200"), wing / "wing.cls", cell=wing / "cell.toml", force=force).to_frame()


def _new(_: Path) -> pd.DataFrame:
    return sa.new_arm("own", mdh=EXAMPLES / "own_robot/dh.csv", payload_kg=60.0, mass_kg=650.0).to_frame()


def _positions(_: Path) -> pd.DataFrame:
    ur5 = EXAMPLES / "ur5"
    return sa.calibrate(sa.load(ur5 / "ur5.toml"), ur5 / "grid.csv", holdout=ur5 / "random.csv").to_frame()


FUNCTIONS: dict[str, Callable[[Path], object]] = {
    "load": lambda _: _xr701().describe(),
    "simulate": lambda _: sa.simulate(_xr701(), pose=POSE, load={"fz_N": -650.0}).to_frame(),
    "replay": lambda _: sa.simulate(_xr701(), data=sa.bundled("xr701")).to_frame(),
    "read_readings": lambda _: sa.read_readings(sa.bundled("xr701"), _xr701()).to_frame(),
    "convert_readings": _converted,
    "calibrate": lambda _: _calibrated().to_frame(),
    "calibrate_positions": _positions,
    "diagnose": lambda _: sa.diagnose(_xr701(), sa.bundled("xr701"), loads=650.0, folds=0).to_frame(),
    "identify": lambda _: sa.identify("tx200", synthetic=True).to_frame(),
    "plan": lambda _: sa.plan(_xr701(), poses=3).to_frame(),
    "rehearse": lambda _: sa.rehearse("kr60-3", hide="friction:j2", poses=9).to_frame(),
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


# Words in commands that stand for folders.
FOLDERS = {
    "KR60": EXAMPLES / "kr60_posture",
    "WING": EXAMPLES / "tx200_wing",
    "BRACKET": EXAMPLES / "kr60_bracket",
    "OWN": EXAMPLES / "own_robot",
    "READINGS": EXAMPLES / "readings",
    "UR5": EXAMPLES / "ur5",
    "UR10": EXAMPLES / "ur10",
}
# A column of more numbers is kept as its summary.
LONGEST = 64
# Parts of keys whose values change from run to run, or with any change of a file's text.
VOLATILE = ("time", "seconds", "sha256", "hash", "finished", "version", "folder", "file", "path", "command")

# Name -> arguments; "{name}" is the folder of an earlier command's results. `serve` answers lines and `help` has no
# figures: their tests compare texts.
COMMANDS: dict[str, str] = {
    "robots": "robots",
    "robots own": "robots xr701 --pose q2_deg=5,q3real_deg=77.5",
    "new": "new my-arm --mdh OWN/dh.csv --payload-kg 60 --mass-kg 650 --springs class --out {new}",
    "robots check": "robots check {new}/my-arm.toml OWN/pendant.csv",
    "readings": "readings READINGS/dial_gauge.xlsx --model kr60-3 --out {table}.csv",
    "readings two": "readings READINGS/leica.csv READINGS/leica_angles.xlsx --model kr60-3 --out {leica}.csv",
    "simulate": "simulate xr701 --pose q2_deg=5,q3real_deg=77.5 --load fz_N=-650",
    "sensitivity": "sensitivity xr701 --poses 5,41,77",
    "staged": "calibrate xr701 --scheme staged --out {staged}",
    "global": "calibrate xr701 --scheme global --out {global}",
    "free": "calibrate xr701 --free j2.stiffness,j3.stiffness,base.ry --out {free}",
    "serial": "calibrate xr701 --scheme global --load-path serial",
    "kr60 table": "calibrate kr60-3 {table}.csv",
    "positions": "calibrate UR10/ur10.toml UR10/series_b.csv --holdout UR10/series_c.csv --out {positions}",
    "compare": "compare {global} {free}",
    "simulated": "simulate {global}/model.toml bundled",
    "diagnose": "diagnose xr701 --loads 650 --load-path serial --out {diagnose}",
    "diagnose all": "diagnose xr701 --out {diagnose-all}",
    "diagnose fanuc": "diagnose fanuc-r2000ic --folds 0",
    "diagnose positions": "diagnose UR5/ur5.toml UR5/grid.csv",
    "rehearse": "rehearse kr60-3 --hide friction:j2 --poses 9",
    "plan": "plan xr701 --poses 3 --out {plan}",
    "fit": "fit {global}/model.toml --out {fit}",
    "query": "query {fit}/surrogate.json --pose q2_deg=5,q3real_deg=77.5",
    "map joints": "map joints {global}/model.toml --no-pictures --out {map}",
    "map joints free": "map joints {free}/model.toml --no-pictures --out {map-free}",
    "compare maps": "compare {map} {map-free}",
    "map slice": "map slice kr60-3 --plane xz --pose best-gamma --no-pictures --out {slice}",
    "map box": "map box kr60-3 --x 600:1400:200 --y -400:400:200 --z 200:1200:250 --no-pictures --out {box}",
    "map cylinder": "map cylinder kr60-3 --r 600:1400:200 --phi -90:90:45 --z 200:1200:250 --no-pictures "
    "--out {cylinder}",
    "map index": "map index kr60-3 --quantity k_fs --x 800:1400:200 --y -200:200:200 --z 600 --tool 200,0,80,0,90,0 "
    "--links rigid --out {index-map}",
    "index": "index kr60-3 --pose q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40 --tool 200,0,80,0,90,0 --force 200,200,200",
    "posture": "posture kr60-3 KR60/path.csv --cell KR60/cell.toml --milling KR60/milling.toml --links rigid "
    "--out {posture}",
    "identify": "identify tx200 --synthetic --out {twists}",
    "place": "place {twists}/model.toml WING/wing.cls --cell WING/cell.toml --force 0,60,-80 --force-axes process "
    "--aim ksf --out {placement}",
    "post": "post {twists}/model.toml WING/wing.cls --cell WING/cell.toml --placement {placement}/placement.json "
    "--format val3,json --out {program}",
    "verify": "verify {twists}/model.toml {program}/json/*.json --cell WING/cell.toml --out {verified}",
    "post bracket": "post kr60-3 BRACKET/bracket.mpf --cell BRACKET/cell.toml --gamma -180:180:5 --format krl,json "
    "--out {bracket}",
    "run": "run xr701 --points 6 --out {run}",
    "import": "import MADE/arm/arm.urdf --size-mm 40 --wall-mm 8 --boss 1 --material aluminium --out {import}",
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--write", type=Path, help="where to keep the figures")
    parser.add_argument("--against", type=Path, help="figures kept before")
    parser.add_argument("--renamed", type=Path, help="table of keys that have another name now: before,now")
    parser.add_argument("--relative", type=float, default=1e-9, help="difference that counts, relative")
    parser.add_argument("--only", nargs="*", help="names of commands, and of functions as python.NAME")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = dict(_all(Path(folder), wanted.only))
    if wanted.write is not None:
        wanted.write.write_text(json.dumps(found, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    if wanted.against is None:
        return 0
    before = json.loads(wanted.against.read_text(encoding="utf-8"))
    if wanted.renamed is not None:
        with wanted.renamed.open(encoding="utf-8", newline="") as table:
            names = {row["before"]: row["now"] for row in csv.DictReader(table)}
        before = {name: {_renamed(key, names): v for key, v in one.items()} for name, one in before.items()}
    differing = [
        line for name in found for line in _differences(name, before.get(name, {}), found[name], wanted.relative)
    ]
    print("\n".join(differing) or "every figure is unchanged")
    return bool(differing)


def _all(folder: Path, only: Sequence[str] | None) -> Iterator[tuple[str, dict[str, float | str]]]:
    made = folder / "made"
    make_inputs(made)
    for name in COMMANDS:
        if only is None or name in only:
            yield name, _figures(name, folder, made)
    for name, function in FUNCTIONS.items():
        if only is None or f"python.{name}" in only:
            print(f"python.{name}", file=sys.stderr)
            yield f"python.{name}", dict(_flat(plain(function(folder)), ""))


def _renamed(key: str, names: Mapping[str, str]) -> str:
    return "".join(names.get(part, part) for part in re.split(r"([.\[\]])", key))


def _figures(name: str, folder: Path, made: Path) -> dict[str, float | str]:
    words = re.sub(r"\{([^}]*)\}", rf"{folder}/\1", COMMANDS[name]).split()
    for place, where in {**FOLDERS, "MADE": made}.items():
        words = [re.sub(rf"^{place}/", f"{where}/", word) for word in words]
    words = [str(next(folder.glob(str(Path(word).relative_to(folder))))) if "*" in word else word for word in words]
    done = subprocess.run(  # noqa: S603 - our own program with constant arguments
        [sys.executable, "-m", "stiffarm", *words, "--json"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    print(f"{name}: exit {done.returncode}", file=sys.stderr)
    if not done.stdout.startswith("{"):
        return {"exit": float(done.returncode), "says": done.stderr.strip().splitlines()[-1] if done.stderr else ""}
    return {"exit": float(done.returncode), **dict(_flat(json.loads(done.stdout), ""))}


def _flat(node: object, key: str) -> Iterator[tuple[str, float | str]]:
    if isinstance(node, dict):
        for name, value in node.items():
            if not any(part in name for part in VOLATILE):
                yield from _flat(value, f"{key}.{name}" if key else str(name))
    elif isinstance(node, list):
        numbers = [float(v) for v in node if isinstance(v, int | float)]
        if len(numbers) > LONGEST:
            summary = {"count": len(numbers), "least": min(numbers), "most": max(numbers)}
            summary |= {"sum": math.fsum(numbers), "squares": math.fsum(v * v for v in numbers)}
            yield from ((f"{key}.{name}", float(value)) for name, value in summary.items())
        else:
            for i, value in enumerate(node[: 4 * LONGEST]):
                yield from _flat(value, f"{key}[{i}]")
    elif isinstance(node, bool | str):
        yield key, str(node)
    elif isinstance(node, int | float):
        yield key, float(node)


def _differences(
    name: str, before: dict[str, float | str], now: dict[str, float | str], relative: float
) -> Iterator[str]:
    for key in sorted(before.keys() | now.keys()):
        a, b = before.get(key), now.get(key)
        if isinstance(a, float) and isinstance(b, float) and math.isclose(a, b, rel_tol=relative, abs_tol=1e-300):
            continue
        if a != b:
            yield f"{name}: {key}: {a} -> {b}"


if __name__ == "__main__":
    sys.exit(main())
