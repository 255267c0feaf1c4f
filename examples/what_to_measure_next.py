"""Which poses would tell more about the springs that nine poses leave open?"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
plan = sa.plan(arm, readings, poses=4, free=["j2.stiffness", "j3.stiffness"])
print(plan)
for sentence in plan.sentences:
    print(sentence)
plan.save("sheet.csv")

frame = plan.to_frame()
plt.scatter(frame["q2_deg"], frame["q3real_deg"])
plt.xlabel("q2 (deg)")
plt.ylabel("q3real (deg)")
plt.savefig("what_to_measure_next.png")

assert len(frame) == 4
