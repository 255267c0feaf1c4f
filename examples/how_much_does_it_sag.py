"""How far does the tool sag under a load?
==========================================

A calibrated XR701 stretches out under 650 N at its tool. The simulation says how far it
sags, and which part deflects most.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
arm = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"]).arm
sag = sa.simulate(arm, pose={"q2_deg": 5, "q3real_deg": 77.5}, load={"fz_N": -650})
print(sag)

parts = (
    -sag.to_frame()
    .set_index("part")["dz_mm"]
    .drop("total")
    .sort_values(ascending=False)
)
figure, ax = plt.subplots(layout="constrained")
parts.plot.barh(ax=ax, xlabel="downwards (mm)", ylabel="")
# Picture: how much each part adds to the sag, as bars. Joint 3 adds nearly all of it,
# the forearm little, the other parts next to nothing.
figure.savefig("how_much_does_it_sag.png")

down = -sag.as_json["dz_mm"]
share = 100 * parts["j3"] / down
print(f"The tool sags {down:.2f} mm; joint 3 alone makes {share:.0f} % of it")
assert parts.idxmax() == "j3"
assert share > 80

# %%
# A stiffer forearm would hardly help this arm: most of the deflection is in the drive
# of joint 3. In other poses it is in another part.
#
# Read on: :doc:`/how-to/shells` shows deformation fields, :doc:`/concepts/mechanics`
# how the parts add up.
