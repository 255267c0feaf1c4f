"""What the paper reads off the map of the XR701, asked of the models that `stiffarm run` calibrates.

    python benchmarks/surrogates/map_findings_page.py [FOLDER] [--write]

FOLDER: results of `stiffarm run xr701`; without it the command is run. ``--write`` writes docs/validation/xr701_map.md
with its figure.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from map_findings import model_findings
from map_findings_figure import findings_figure

from fem import build_model
from robots import load_description
from stiffarm.pages.style import save_png

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "validation" / "xr701_map.md"
HEAD = """# The paper's findings on the map of the XR701

Two of the paper's three findings hold in part in both models. The third, that soft and stiff regions lie close
together in the middle of the workspace, holds in the model of the published scheme but not in the one that predicts
left-out poses best. So it depends on how the springs vary at angles that nobody has measured; it says little about the
arm itself.

Measured by `python benchmarks/surrogates/map_findings_page.py --write`.

Gotlih, Karner, Gotlih and Brezocnik, "Experiment based structural stiffness calibration of a virtual robot model",
section 3, draw three conclusions from their stiffness map: low stiffness far from the main Z axis and at large stretch,
soft and stiff regions close together in the middle of the workspace, and q4 almost without influence. Here they are
checked at 20 000 poses spread evenly over the joint ranges of two models that `stiffarm run xr701` calibrates: the one
that predicts left-out poses best, and that of the published scheme. Geometry and readings are the same; the models
differ in how springs depend on the joint angles, between and beyond the measured poses.

"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--write", action="store_true")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = wanted.folder or Path(place) / "run"
        if wanted.folder is None:
            command = [sys.executable, "-m", "stiffarm", "run", "xr701", "--points", "6", "--out", str(folder)]
            subprocess.run(command, check=True, cwd=ROOT)  # noqa: S603 - our own program with constant arguments
        text = page(folder, PAGE.with_suffix(".png") if wanted.write else None)
    print(text)
    if wanted.write:
        PAGE.write_text(text, encoding="utf-8")
    return 0


def page(folder: Path, figure: Path | None) -> str:
    """The page for the results of a run; ``figure``: where the recommended model's goes."""
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    best, published = results["recommended"], next(iter(results["variants"]))
    names = {best: "recommended", published: "the published scheme"} if best != published else {best: "recommended"}
    found = {}
    for name in names:
        file = folder / "models" / f"{'_'.join(name.replace(',', ' ').split())}.toml"
        found[name] = model_findings(build_model(load_description(file)))
    samples, claims = found[best]
    lines = ["| claim | " + " | ".join(f"{name} ({role})" for name, role in names.items()) + " |"]
    lines.append("|---|" + "---|" * len(names))
    for k, claim in enumerate(claims):
        lines.append(f"| {claim.claim} | " + " | ".join(found[name][1][k].verdict for name in names) + " |")
    for name, (_, ones) in found.items():
        lines += ["", f"## {name[:1].upper()}{name[1:]}", "", *(f"- {one.sentence}" for one in ones)]
    if samples is not None and figure is not None:
        save_png(findings_figure(samples, "ACMA XR701: what its stiffness depends on"), figure)
        lines += ["", f"![what the stiffness of the recommended model depends on]({figure.name})"]
    lines += ["", "## What the verdicts mean", "", *(f"- {one.claim}: {one.thresholds}." for one in claims)]
    return HEAD + "\n".join(lines).replace("\u00a0", " ") + "\n"


if __name__ == "__main__":
    sys.exit(main())
