"""Serial chain or parallelogram?
=================================

A bar of the XR701 carries the forearm's load past the upper arm; this model is told
that the arm is a serial chain. Nine readings at one load are enough to find the
mistake.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
why = sa.diagnose(arm, readings, loads_N=[650], load_path="serial", next_poses=0)
print(why.title())

first = why.to_frame().head(6)[::-1]
figure, ax = plt.subplots(layout="constrained")
ax.barh(first["candidate"], 100 * first["probability"])
ax.set(xlabel="probability (%)", title="What is missing from the serial model?")
# Picture: bars of the six most probable explanations. The load path has nearly all of
# the probability.
figure.savefig("what_is_missing.png")

share = why.to_frame().set_index("candidate").loc["load-path", "probability"]
print(f"The load path is missing with a probability of {100 * share:.0f} %")
assert why.effects == ("load-path",)
# At poses not seen, with effects chosen anew for each: nine poses make the choice hard.
assert why.gap.held_out_after_mm < 0.85 * why.gap.held_out_before_mm

# %%
# The diagnosis knows nothing of this robot but its serial model, and asks every effect
# that it may have. It names one only where the evidence leaves no other explanation,
# and where it predicts poses better that took no part.
#
# Read on: :doc:`/how-to/diagnose`; how often it is right:
# :doc:`/validation/diagnosis_study`.
