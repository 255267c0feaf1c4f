"""How much does the arm sag under 65 kg, and which part gives way most?"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
arm = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"]).arm
sag = sa.simulate(arm, {"q2_deg": 5, "q3real_deg": 77.5}, {"fz_N": -650})
print(sag)

parts = sag.to_frame().set_index("part")["dz_mm"].drop("total").sort_values()
parts.plot.barh(xlabel="vertical displacement (mm)")
plt.tight_layout()
plt.savefig("how_much_does_it_sag.png")

assert parts.index[0] == "j3"
