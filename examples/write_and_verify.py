"""Does a program that was written from a tool path run in the cell?"""

from pathlib import Path

import stiffarm as sa

part = Path(__file__).resolve().parent.parent / "docs" / "examples" / "kr60_posture"
arm = sa.load("kr60-3", links="rigid")
program = sa.post(
    arm, part / "path.csv", "programs", cell=part / "cell.toml", formats=["krl", "json"], gamma_deg=(-180, 180, 5)
)
print(program)
checked = sa.verify(arm, "programs/json/part.json", part / "cell.toml")
print(checked)
checked.plot("write_and_verify.png")

assert program.to_frame()["tip_um"].max() < 1.0
