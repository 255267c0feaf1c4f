"""How stiff are the joints of a real FANUC?
============================================

The tool of a FANUC R-2000iC was pulled in 43 poses, and its displacement was measured
along three axes. From these readings every joint gets a stiffness, and an interval that
says how sure it is.
"""

import matplotlib.pyplot as plt
import numpy as np

import stiffarm as sa

arm = sa.load("fanuc-r2000ic")
readings = sa.read_readings(sa.bundled("fanuc-r2000ic"), arm)
cal = sa.calibrate(arm, readings)
print(cal)

frame = sa.simulate(cal.arm, data=readings).to_frame()
assert len(frame) == 43
measured = np.concatenate([frame[f"d{axis}_measured_mm"] for axis in "xyz"])
figure, ax = plt.subplots(layout="constrained")
for axis in "xyz":
    ax.scatter(
        frame[f"d{axis}_measured_mm"], frame[f"d{axis}_simulated_mm"], s=18, label=axis
    )
ax.axline((0.0, 0.0), slope=1.0, color="grey")
ax.set(xlabel="measured (mm)", ylabel="calibrated model (mm)")
ax.legend(title="axis")
# Picture: simulated against measured displacements of the tool along x, y and z in 43
# poses. The points follow the diagonal and scatter about it.
figure.savefig("calibrate_a_fanuc.png")

whole = np.sqrt(np.mean(measured**2))
left_out = cal.left_out_rms_mm
print(f"Poses left out: {left_out:.3f} mm RMS, of displacements of {whole:.3f} mm RMS")
assert cal.facts["count"]["identified"] == cal.facts["count"]["free"] == 6
assert 0.2 < left_out / whole < 0.5

# %%
# Each pose is predicted by a calibration without it, so the last line is the error to
# expect from six springs at a new pose. All six are identified, but they leave part of
# the readings unexplained.
#
# Read on: :doc:`/how-to/calibrate`, :doc:`/validation/fanuc`. Next: what is left,
# :doc:`what_else_gives_way`.
