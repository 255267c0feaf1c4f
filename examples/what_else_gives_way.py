"""What else gives way in the FANUC?
====================================

Six springs leave a good part of the readings of a FANUC R-2000iC unexplained. The
diagnosis tests every effect of the catalogue against the readings and names what it can
prove.
"""

import matplotlib.pyplot as plt
import numpy as np

import stiffarm as sa

arm = sa.load("fanuc-r2000ic")
readings = sa.read_readings(sa.bundled("fanuc-r2000ic"), arm)
why = sa.diagnose(arm, readings, next_poses=0, folds=0)
print(why.answer)
print(why.to_frame().head(6).to_string(index=False, float_format="{:.3g}".format))

figure, ax = plt.subplots(layout="constrained")
models = {"six springs": sa.calibrate(arm, readings).arm, "diagnosed": why.arm}
for name, model in models.items():
    frame = sa.simulate(model, data=readings).to_frame()
    simulated, measured = frame.filter(like="simulated"), frame.filter(like="measured")
    off = np.linalg.norm(simulated.to_numpy() - measured.to_numpy(), axis=1)
    ax.step(np.sort(off), np.linspace(0, 100, len(off)), label=name)
assert len(off) == 43
ax.set(xlabel="distance from the measurement (mm)", ylabel="poses that are nearer (%)")
ax.legend()
# Picture: for two models, the share of the 43 poses that are nearer to the measurement
# than a distance. The curve with the effects that were found rises earlier all the way.
figure.savefig("what_else_gives_way.png")

before, after = why["unseen_rms_before_mm"], why["unseen_rms_after_mm"]
print(f"Unseen poses: {before:.3f} mm RMS with six springs, {after:.3f} mm diagnosed")
assert {"tool-compliance", "joint-tilt:j3"} <= set(why.effects)
assert after < 0.7 * before

# %%
# Joint 3 tilts in its bearing, and the tool or the sensor deflects: gear springs can
# represent neither. The third name is not sure. A rotated force frame and a zero error
# of joint 1 change all readings in the same way, so the verdict is ambiguous and asks
# you to check the set-up.
#
# The effects were chosen on all poses, which makes the last line a little too good;
# :doc:`/validation/fanuc` has folds in which they are chosen again. Read on:
# :doc:`/how-to/diagnose`, :doc:`/concepts/diagnosis`.
