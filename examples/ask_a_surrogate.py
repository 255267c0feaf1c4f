"""How stiff is it as the arm leans?
====================================

A surrogate was fitted to the calibrated XR701 and answers in microseconds. Each answer
has an error bar that includes the uncertainty of the calibration.
"""

import matplotlib.pyplot as plt
import pandas as pd

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
arm = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"]).arm
surrogate = sa.fit(arm)
print(surrogate)
poses = pd.DataFrame({"q2_deg": range(-30, 41, 5), "q3real_deg": 77.5})
answers = surrogate.query(q_deg=poses)

frame = answers.to_frame()
figure, ax = plt.subplots(layout="constrained")
low, high = frame["stiffness_low95_N_per_mm"], frame["stiffness_high95_N_per_mm"]
q2 = frame["q2_deg"]
ax.fill_between(q2, low, high, alpha=0.3, label="95 %")
ax.plot(q2, answers.values, label="surrogate")
ax.set(xlabel="q2 (deg)", ylabel="vertical stiffness (N/mm)", ylim=(0, None))
ax.legend()
# Picture: the stiffness over the angle of the upper arm with a 95 % band. It hardly
# changes at first and then more than doubles.
figure.savefig("ask_a_surrogate.png")

first, last = answers.values[[0, -1]]
print(f"{first:.0f} N/mm at -30 deg, {last:.0f} N/mm at 40 deg")
assert last > 2 * first
assert surrogate.learned.errors.max_relative < 1e-6

# %%
# The surrogate reproduces the model to rounding error, so the band is the uncertainty
# that nine poses of readings leave: a better answer takes more readings, not a better
# fit.
#
# Read on: :doc:`/how-to/surrogate`, :doc:`/validation/surrogate_accuracy`. Outside of
# Python: :doc:`a_surrogate_in_c`.
