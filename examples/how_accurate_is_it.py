"""How accurate is a UR5, how accurate could it be, and is joint 1 or the geometry to blame?"""

from pathlib import Path

import matplotlib.pyplot as plt

import stiffarm as sa

files = Path(sa.__file__).parents[1] / "docs" / "examples" / "ur5"
arm = sa.load(files / "ur5.toml")
geometry = sa.calibrate_positions(arm, files / "grid.csv", free=["geometry"])
found = sa.calibrate_positions(arm, files / "grid.csv", holdout=files / "random.csv")
print(found)
print("\n".join(found.remarks))

curve = found.curve("j1").dropna()
low, high = (curve["error_mrad"] + sign * curve["half95_mrad"] for sign in (-1, 1))
plt.fill_between(curve["angle_deg"], low, high, alpha=0.3, label="95 %")
plt.plot(curve["angle_deg"], curve["error_mrad"], label="joint 1")
plt.xlabel("angle of joint 1 (deg)")
plt.ylabel("error of joint 1 (mrad)")
plt.legend()
plt.savefig("how_accurate_is_it.png")

assert found.holdout_rms_mm < 0.75 * geometry.left_out_rms_mm < 0.2 * found.before_rms_mm
