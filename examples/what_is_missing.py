"""Serial chain or parallelogram?
=================================

A bar of the XR701 carries the forearm's load past the upper arm, but this model treats
the arm as a serial chain. Nine readings at one load are enough to find the mistake.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701", load_path="serial")
readings = sa.read_readings(sa.bundled("xr701"), arm)
why = sa.diagnose(arm, readings, loads=[650], next_poses=0)
print(why.answer)

first = why.to_frame().head(6)[::-1]
figure, ax = plt.subplots(layout="constrained")
ax.barh(first["code"], 100 * first["probability"])
ax.set(xlabel="probability (%)", title="What is missing from the serial model?")
# Picture: bars of the six most probable explanations. The load path has nearly all of
# the probability.
figure.savefig("what_is_missing.png")

share = why.to_frame().set_index("code").loc["load-path", "probability"]
print(f"The load path is missing with a probability of {100 * share:.0f} %")
assert why.effects == ("load-path",)
# At poses not seen, with effects chosen anew for each: nine poses make the choice hard.
assert why["unseen_rms_after_mm"] < 0.85 * why["unseen_rms_before_mm"]

# %%
# The diagnosis knows only the serial model of this robot, and tests every effect that
# the arm may have. It names one only if the evidence leaves no other explanation and it
# improves the prediction of poses left out of the fit.
#
# Read on: :doc:`/how-to/diagnose`; how often it is right:
# :doc:`/validation/diagnosis_study`.
