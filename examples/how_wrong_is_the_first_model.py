"""How wrong is a model without joints?
=======================================

A model from drawings has links that bend and joints that do not. Here it is compared
with measurements on an XR701, reading by reading.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
first = sa.simulate(arm, data=readings)
print(first.answer)

frame = first.to_frame()
figure, ax = plt.subplots(layout="constrained")
ax.loglog(-frame["dz_measured_mm"], -frame["dz_simulated_mm"], "o")
ax.axline((0.1, 0.1), (1.0, 1.0), color="grey", linestyle=":", label="what should be")
ax.set(xlabel="measured (mm)", ylabel="simulated with rigid joints (mm)")
ax.legend()
# Picture: simulated against measured deflections, both on logarithmic axes. All points
# lie far below the diagonal.
figure.savefig("how_wrong_is_the_first_model.png")

times = (frame["dz_measured_mm"] / frame["dz_simulated_mm"]).median()
print(f"The arm deflects {times:.0f} times as much as its links alone (median)")
assert times > 5

# %%
# Most of an industrial arm's compliance is in its joints, and no drawing shows it: the
# stiffness of gears, bearings and their preload must be measured. The points
# nevertheless lie along a line, which is why a few springs correct the model.
#
# Next: :doc:`which_springs`. Read on: :doc:`/concepts/mechanics`.
