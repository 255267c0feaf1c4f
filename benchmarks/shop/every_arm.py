"""Every arm of the library follows a square: `posture`, `post`, `verify`, and nothing of it below its own floor.

    python benchmarks/shop/every_arm.py [--arms ur20,kr16-2] [--write]

The square has sides of 200 mm, or of a tenth of the reach where that is less; the tool stands 100 mm beside and 80 mm
before the flange. Whether the arm stays above the plane that it stands on is asked of the written joint program, by
kinematics and points of its own: nothing of stiffarm is imported here. ``--write`` writes docs/validation/every_arm.md.
"""

from __future__ import annotations

import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.asked import asked

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "validation" / "every_arm.md"
DATA = ROOT / "robots" / "data"
# mm and deg to m and rad.
UNITS = {"mm": 1e-3, "m": 1.0, "deg": math.pi / 180.0, "rad": 1.0}
TOOL = np.array([0.1, 0.0, 0.08])
# Points on each way from joint to joint, poses between two points of the program, and how thick (of the reach) all is.
ON_WAY, BETWEEN, THICK = 25, 4, 0.02
HEAD = """# Every arm follows a square

{clean} of {count} arms follow a square with `posture`, `post` and `verify` without an offence, and none of them goes
below the plane that it stands on. Written by `python benchmarks/shop/every_arm.py --write`, which asks that of the
written joint angles with kinematics of its own, read from the model files.

The square: sides of 200 mm, or a tenth of the reach where that is less, at {x:.0%} of the reach before axis 1 and
{z:.0%} above the floor, tool 100 mm beside and 80 mm before the flange. *Elbow*: least height of joint 3 over the
robot's mounting plane. *Lowest*: least height of any point of the arm beyond its first joint, taken as a tube with a
radius of 2 % of the reach. *Posture* chooses gamma from a full turn; *post* keeps the one that it found.

| arm | reach, mm | format | gamma, deg | elbow, mm | lowest, mm | nearest bodies (verify) | offences | s |
|---|---|---|---|---|---|---|---|---|
"""
AT_X, AT_Z = 0.5, 0.3


def si(quantity: dict[str, Any]) -> Any:
    """A figure of a model file in m or rad."""
    factor = UNITS[quantity["unit"]]
    value = quantity["value"]
    return [v * factor for v in value] if isinstance(value, list) else value * factor


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation by Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def rpy(angles: list[float]) -> np.ndarray:
    """Fixed-axis roll, pitch, yaw."""
    r, p, y = angles
    ez, ey, ex = np.eye(3)[2], np.eye(3)[1], np.eye(3)[0]
    return about(ez, y) @ about(ey, p) @ about(ex, r)


def joint_origins(model: dict[str, Any], q: np.ndarray) -> np.ndarray:
    """Origins (dof + 2, 3) m of base, joints and flange at a pose q rad."""
    R, p, out = np.eye(3), np.zeros(3), [np.zeros(3)]
    for joint, angle in zip(model["joint"], q, strict=True):
        turn = joint.get("sign", 1) * angle + (si(joint["offset"]) if "offset" in joint else 0.0)
        if "dh" in joint:
            alpha, a, d = (si(joint["dh"][key]) for key in ("alpha", "a", "d"))
            R_x = about(np.eye(3)[0], alpha)
            p = p + R @ np.array([a, 0.0, 0.0]) + R @ R_x @ np.array([0.0, 0.0, d])
            R = R @ R_x @ about(np.eye(3)[2], turn)
        else:
            frame = joint["frame"]
            p = p + R @ np.array(si(frame["xyz"]))
            R = R @ rpy(si(frame["rpy"]) if "rpy" in frame else [0.0, 0.0, 0.0])
            R = R @ about(np.array(frame.get("axis", [0, 0, 1]), dtype=float), turn)
        out.append(p)
    return np.array([*out, p + R @ np.array(si(model["flange"]["xyz"]))])


def lowest(model: dict[str, Any], poses: np.ndarray, thick: float) -> tuple[float, float]:
    """Least height (m) of joint 3, and of any point of a tube along the arm from joint 2 on, between the poses too."""
    elbow, low = np.inf, np.inf
    share = np.linspace(0.0, 1.0, ON_WAY)[:, None]
    for a, b in pairwise(poses):
        for t in np.arange(BETWEEN) / BETWEEN:
            at = joint_origins(model, a + t * (b - a))
            elbow = min(elbow, float(at[3, 2]))
            ways = [start + share * (end - start) for start, end in pairwise(at[2:])]
            low = min(low, float(np.vstack(ways)[:, 2].min()) - thick)
    return elbow, low


def run(*words: str) -> tuple[int, dict[str, Any], str]:
    """A command's exit code, its JSON, and what it said."""
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-m", "stiffarm", *words, "--json"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        cwd=ROOT,
    )
    lines = done.stdout.strip()
    return done.returncode, json.loads(lines) if lines.startswith("{") else {}, done.stderr.strip()


def square(side: float) -> str:
    """G-code of the square (mm), with a point at least every tenth of a side."""
    corners = [(0, 0), (side, 0), (side, side), (0, side), (0, 0)]
    lines = ["G21 G90", "G1 X0 Y0 Z0 F1000"]
    for (x0, y0), (x1, y1) in pairwise(corners):
        lines += [f"X{x0 + (x1 - x0) * k / 10:.4f} Y{y0 + (y1 - y0) * k / 10:.4f}" for k in range(1, 11)]
    return "\n".join([*lines, "M30", ""])


def one(name: str, where: Path) -> dict[str, Any]:
    """What came of one arm."""
    started = time.perf_counter()
    file = DATA / f"{name}.toml"
    model = tomllib.loads((file if file.is_file() else DATA / "library" / f"{name}.toml").read_text(encoding="utf-8"))
    zero = joint_origins(model, np.zeros(len(model["joint"])))
    reach = float(np.linalg.norm(np.diff(zero[2:], axis=0), axis=1).sum())
    side = 1e3 * min(0.2, 0.1 * reach)
    path = where / f"{name}.nc"
    path.write_text(square(side), encoding="utf-8")
    place = f"{1e3 * AT_X * reach - side / 2:.0f},{-side / 2:.0f},{1e3 * AT_Z * reach:.0f}"
    frames = ["--part", place, "--tool", ",".join(f"{1e3 * v:g}" for v in TOOL)]
    formats = model.get("controller", {}).get("formats", [])
    out: dict[str, Any] = {"reach": 1e3 * reach, "format": ", ".join(formats) or "csv, json"}
    code, found, said = run("posture", name, str(path), *frames)
    if code:
        return out | {"failed": f"posture: {said.splitlines()[-1]}"}
    low, high = (found["courses"][0][f"gamma_{end}_deg"] for end in ("from", "to"))
    out["gamma"] = f"{low:.4g}" if high - low < 1e-6 else f"{low:.4g} to {high:.4g}"
    folder = where / name
    gamma = f"{low:.6f}" if high - low < 1e-6 else "-180:180:5"
    formats = ",".join(dict.fromkeys([*formats[:1], "json", "csv"]))
    code, found, said = run(
        "post", name, str(path), *frames, "--gamma", gamma, "--format", formats, "--out", str(folder)
    )
    if code:
        return out | {"failed": f"post: {said.splitlines()[-1]}"}
    code, found, said = run("verify", name, str(next(folder.glob("json/*.json"))), *frames)
    if code not in (0, 1):
        return out | {"failed": f"verify: {said.splitlines()[-1]}"}
    with next(folder.glob("csv/*.csv")).open(encoding="utf-8") as text:
        rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    names = [f"q{i + 1}_deg" for i in range(len(model["joint"]))]
    poses = np.radians([[float(row[key]) for key in names] for row in rows])
    elbow, least = lowest(model, poses, THICK * reach)
    pair = found["least_distance_bodies"]
    return out | {
        "elbow": 1e3 * elbow,
        "lowest": 1e3 * least,
        "nearest": "over 50 mm" if pair is None else f"{' and '.join(pair)}: {found['least_distance_mm']:.3g} mm",
        "offences": said.splitlines()[-1] if code else "none",
        "code": code,
        "seconds": time.perf_counter() - started,
    }


def names_of_arms() -> list[str]:
    """All arms that come with stiffarm."""
    return sorted(file.stem for file in (*DATA.glob("*.toml"), *(DATA / "library").glob("*.toml")))


def main() -> None:
    """Run the arms and print, or write, the table."""
    given = asked(__doc__, arms="", write=False)
    names = given.arms.split(",") if given.arms else names_of_arms()
    rows, clean = [], 0
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            found = one(name, Path(folder))
            if "failed" in found:
                row = f"| {name} | {found['reach']:.0f} | {found['format']} | | | | | {found['failed']} | |"
            else:
                clean += found["code"] == 0 and found["lowest"] >= 0.0
                row = (
                    f"| {name} | {found['reach']:.0f} | {found['format']} | {found['gamma']} | {found['elbow']:.0f} | "
                    f"{found['lowest']:.0f} | {found['nearest']} | {found['offences']} | {found['seconds']:.0f} |"
                )
            print(row, flush=True)
            rows.append(row)
    print(f"{clean} of {len(names)} clean")
    if given.write:
        head = HEAD.format(clean=clean, count=len(names), x=AT_X, z=AT_Z)
        PAGE.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
