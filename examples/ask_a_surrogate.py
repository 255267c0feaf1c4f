"""How does the stiffness change as the upper arm leans, and how sure is that?"""

import matplotlib.pyplot as plt
import pandas as pd

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
arm = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"]).arm
surrogate = sa.fit(arm, runs=1000, basis="polynomial")
poses = pd.DataFrame({"q2_deg": range(-30, 41, 5), "q3real_deg": 77.5})
answers = surrogate.query(q_deg=poses)
print(answers)

frame = answers.to_frame()
plt.fill_between(frame["q2_deg"], frame["low95"], frame["high95"], alpha=0.3, label="95 %")
plt.plot(frame["q2_deg"], answers.values, label="surrogate")
plt.xlabel("q2 (deg)")
plt.ylabel("stiffness under a vertical load (N/mm)")
plt.legend()
plt.savefig("ask_a_surrogate.png")

assert answers.values[-1] > 1.5 * answers.values[0]
