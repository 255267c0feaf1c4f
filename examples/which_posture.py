"""How much stiffer can a milling robot stand along a path if gamma is free?"""

from pathlib import Path

import stiffarm as sa

part = Path(__file__).resolve().parent.parent / "docs" / "examples" / "kr60_posture"
arm = sa.load("kr60-3", links="rigid")
posture = sa.posture(arm, part / "path.csv", cell=part / "cell.toml")
print(posture)

posture.plot("which_posture.png")

assert posture.gain is not None
assert posture.gain[0] >= 1.0
