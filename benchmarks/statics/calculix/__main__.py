"""Write a bundled arm, or one from a model file, as an input for CalculiX, with what stiffarm says of it.

    python -m benchmarks.statics.calculix xr701 --pose-deg 20 5 77.5 30 40 10 --out arm.inp
    ccx arm

``arm.dat`` then holds the tool point's displacement (sets TOOL in mm, TOOL_ROT in rad); the deck's head has ours.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from benchmarks.statics.calculix.arm import arm_deck
from fem import build_model
from robots import load_description


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("model", help="a bundled robot or a model file")
    parser.add_argument("--pose-deg", type=float, nargs="+", required=True, help="all joint coordinates")
    parser.add_argument("--load", type=float, nargs=6, default=(0.0, 0.0, -650.0, 0.0, 0.0, 0.0), help="N, N m")
    parser.add_argument("--links", default="shell", help="shell, solid, shell:distributing, ...")
    parser.add_argument("--out", type=Path, default=Path("arm.inp"))
    asked = parser.parse_args()
    model = build_model(load_description(asked.model), links=asked.links)
    deck = arm_deck(model, np.radians(asked.pose_deg), np.array(asked.load), title=[model.robot.name])
    asked.out.write_text(deck.text, encoding="ascii")
    sys.stdout.write(f"{asked.out}: {deck.nodes} nodes, {deck.elements} elements; ours {deck.displacement}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
