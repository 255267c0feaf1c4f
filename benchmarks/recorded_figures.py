"""Every figure that the commands print on bundled inputs, recorded, so that "unchanged" can be shown.

``python benchmarks/recorded_figures.py --write figures.json`` runs the commands and keeps the figures of their JSON;
``--against figures.json`` runs them again and names each that differs by more than ``--relative``. Long columns are
kept as their count, extremes, sum and sum of squares. Times and hashes are left out.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KR60, WING = ROOT / "docs/examples/kr60_posture", ROOT / "docs/examples/tx200_wing"
# A column of more numbers is kept as its summary.
LONGEST = 64
# Parts of keys whose values change from run to run, or with any change of a file's text.
VOLATILE = ("time", "seconds", "sha256", "hash", "finished", "version", "folder", "file", "path", "command")

# Name -> arguments; "{name}" is the folder of an earlier command's results.
COMMANDS: dict[str, str] = {
    "robots": "robots",
    "simulate": "simulate xr701 --pose q2_deg=5,q3real_deg=77.5 --load fz_N=-650",
    "sensitivity": "sensitivity xr701 --poses 5,41,77",
    "staged": "calibrate xr701 --scheme staged --out {staged}",
    "global": "calibrate xr701 --scheme global --out {global}",
    "free": "calibrate xr701 --free j2.stiffness,j3.stiffness,base.ry --out {free}",
    "serial": "calibrate xr701 --scheme global --load-path serial",
    "simulated": "simulate {global}/model.toml bundled",
    "diagnose": "diagnose xr701 --loads 650 --load-path serial --out {diagnose}",
    "diagnose all": "diagnose xr701 --out {diagnose-all}",
    "diagnose fanuc": "diagnose fanuc-r2000ic --folds 0",
    "rehearse": "rehearse kr60-3 --hide friction:j2 --poses 9",
    "plan": "plan xr701 --poses 3 --out {plan}",
    "fit": "fit {global}/model.toml --out {fit}",
    "query": "query {fit}/surrogate.json --pose q2_deg=5,q3real_deg=77.5",
    "map joints": "map joints {global}/model.toml --no-pictures --out {map}",
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
    "verify": "verify {twists}/model.toml {program}/json/wing.json --cell WING/cell.toml --out {verified}",
    "run": "run xr701 --points 6 --out {run}",
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--write", type=Path, help="where to keep the figures")
    parser.add_argument("--against", type=Path, help="figures kept before")
    parser.add_argument("--relative", type=float, default=1e-9, help="difference that counts, relative")
    parser.add_argument("--only", nargs="*", default=list(COMMANDS), help="names of commands")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = {name: _figures(name, Path(folder)) for name in COMMANDS if name in wanted.only}
    if wanted.write is not None:
        wanted.write.write_text(json.dumps(found, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    if wanted.against is None:
        return 0
    before = json.loads(wanted.against.read_text(encoding="utf-8"))
    differing = [line for name in found for line in _differences(name, before[name], found[name], wanted.relative)]
    print("\n".join(differing) or "every figure is unchanged")
    return bool(differing)


def _figures(name: str, folder: Path) -> dict[str, float | str]:
    words = COMMANDS[name].replace("KR60", str(KR60)).replace("WING", str(WING)).replace("{", f"{folder}/{{").split()
    words = [word.replace("{", "").replace("}", "") for word in words]
    done = subprocess.run(  # noqa: S603 - our own program with constant arguments
        [sys.executable, "-m", "stiffarm", *words, "--json"],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
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
