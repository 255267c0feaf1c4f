"""What should we measure next?
===============================

Nine poses do not identify the wrist of the XR701: joint 4 has only a lower limit, joint
5 is at its bound. The plan chooses the six set-ups that add most, and writes the sheet
to fill in.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
springs = [f"{joint}.stiffness" for joint in ("j2", "j3", "j4", "j5")]
plan = sa.plan(arm, readings, poses=6, free=springs)
print(*plan.sentences[:4], sep="\n")
plan.save("sheet.csv")

so_far, frame = readings.to_frame(), plan.to_frame()
figure, ax = plt.subplots(layout="constrained")
ax.scatter(so_far["q4_deg"], so_far["q5_deg"], color="grey", label="measured")
ax.scatter(frame["q4_deg"], frame["q5_deg"], marker="x", s=60, label="to measure")
for pose, q4, q5 in frame[["pose", "q4_deg", "q5_deg"]].itertuples(index=False):
    ax.annotate(pose, (q4 + 5, q5 + 3))
ax.set(xlabel="q4 (deg)", ylabel="q5 (deg)")
ax.legend()
# Picture: angles of joints 4 and 5. All measured poses share three places, the six
# planned ones lie elsewhere.
figure.savefig("what_to_measure_next.png")

worth = plan.found.made.random_needed
print(f"These {len(frame)} set-ups tell as much as {worth} set-ups chosen at random")
assert worth > 2 * len(frame)

# %%
# Fill in `sheet.csv` at the robot and read it together with the first table:
# `sa.read_readings([sa.bundled("xr701"), "sheet.csv"], arm)`. Joint 4 gains most. The
# forecast includes the lack of fit of the readings so far: repeats alone do not average
# it away.
#
# Read on: :doc:`/how-to/plan`. How often such forecasts come true:
# :doc:`/validation/forecasts`.
