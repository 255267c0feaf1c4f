"""How much of the measured deflection do the links alone explain, before any joint is calibrated?"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
first = sa.replay(arm, readings)
print(first)

frame = first.to_frame()
plt.scatter(-frame["dz_mm_measured"], -frame["dz_mm_simulated"])
plt.axline((0.0, 0.0), slope=1.0, color="grey")
plt.xlabel("measured (mm)")
plt.ylabel("simulated with rigid joints (mm)")
plt.savefig("how_wrong_is_the_first_model.png")

assert (frame["dz_mm_measured"] / frame["dz_mm_simulated"]).median() > 5.0
