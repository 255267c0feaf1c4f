"""What else gives way in the FANUC?
====================================

Six springs leave a good part of what was measured on a FANUC R-2000iC unexplained.
The diagnosis holds every effect of the catalogue against the readings and names what it can prove.
"""

import matplotlib.pyplot as plt
import numpy as np

import stiffarm as sa

arm = sa.load("fanuc-r2000ic")
readings = sa.read_readings(sa.bundled("fanuc-r2000ic"), arm)
why = sa.diagnose(arm, readings, next_poses=0, folds=0)
print(why.title())
print(why.to_frame().head(6).to_string(index=False, float_format=lambda value: f"{value:.3g}"))

figure, ax = plt.subplots(layout="constrained")
for name, model in {"six springs": sa.calibrate(arm, readings).arm, "with what was found": why.arm}.items():
    frame = sa.replay(model, readings).to_frame()
    off = [frame[f"d{axis}_mm_simulated"] - frame[f"d{axis}_mm_measured"] for axis in "xyz"]
    ax.step(np.sort(np.linalg.norm(off, axis=0)), np.linspace(0, 100, len(frame)), label=name)
assert len(frame) == 43
ax.set(xlabel="distance from what was measured (mm)", ylabel="poses that are nearer (%)")
ax.legend()
# Picture: for two models, the share of the 43 poses that are nearer to the measurement than a distance. The curve with
# the effects that were found rises earlier all the way.
figure.savefig("what_else_gives_way.png")

gap = why.gap
print(f"Unseen poses: {gap.held_out_before_mm:.3f} mm RMS with six springs, {gap.held_out_after_mm:.3f} mm diagnosed")
assert {"tool-compliance", "joint-tilt:j3"} <= set(why.effects)
assert gap.held_out_after_mm < 0.7 * gap.held_out_before_mm

# %%
# Joint 3 tilts in its bearing, and the tool or the sensor gives way: gear springs can hold neither. The third name is not
# sure. A frame of forces that is turned and a zero error of joint 1 move all readings alike, so the verdict is ambiguous
# and asks you to look at the set-up.
#
# The effects were chosen with all poses in view, which flatters the last line a little; folds that choose anew are in
# :doc:`/validation/fanuc`. Read on: :doc:`/how-to/diagnose`, :doc:`/concepts/diagnosis`.
