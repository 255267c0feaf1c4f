"""Which model can you trust tomorrow?
======================================

Four models are calibrated on one campaign of a UR10, series B, and judged by folds within it, as is usual.
Then each predicts series C, another campaign of the same arm at other angles.
"""

import matplotlib.pyplot as plt
import pandas as pd

import stiffarm as sa

files = "docs/examples/ur10"
arm = sa.load(f"{files}/ur10.toml")
models = {
    "geometry": ["geometry"],
    "+ springs": ["geometry", "springs"],
    "+ 4 harmonics": ["geometry", "springs", "periodic4"],
    "+ error curves": ["geometry", "springs", "periodic"],
}
rms_mm = {}
for name, free in models.items():
    found = sa.calibrate_positions(arm, f"{files}/series_b.csv", free=free, holdout=f"{files}/series_c.csv")
    rms_mm[name] = {"folds in B": found.left_out_rms_mm, "series C": found.holdout_rms_mm}
table = pd.DataFrame(rms_mm).T
print(table.round(3).to_string())

figure, ax = plt.subplots(layout="constrained")
table.plot.bar(ax=ax, rot=0, logy=True, ylim=(0.05, 10), ylabel="RMS distance (mm)")
for bars in ax.containers:
    ax.bar_label(bars, fmt="%.2f")
# Picture: four models, each with its error in folds within series B and its error in series C. From left to right the
# folds fall all the way; the third model's error in series C stands far above all others.
figure.savefig("which_model_is_honest.png")

wild, plain = table.loc["+ 4 harmonics"], table.loc["+ springs"]
print(f"4 harmonics: {wild['folds in B']:.2f} mm in folds, {wild['series C']:.2f} mm in the next campaign")
assert table["folds in B"].is_monotonic_decreasing
assert wild["series C"] > 5 * plain["series C"]
assert table["series C"].idxmin() == "+ error curves"

# %%
# **Folds within a campaign praise a model that fails in the next one.** By the folds each model beats the one before. In
# series C the four harmonics are the worst by far: joint 1 stands there at angles that series B never had, and harmonics
# run away beyond the angles that were read.
#
# The model with springs promised less and nearly kept it. Folds flatter the error curves as well, yet these predict series
# C best: they stay at zero where nothing was read, and intervals there allow for what is not known. So hold out readings of
# another campaign at other angles, and take the model that predicts those.
#
# Read on: :doc:`/how-to/positions`, :doc:`/validation/positions`, :doc:`/concepts/uncertainty`. The readings are by
# Landgraf et al. (CASE 2021), MIT licence; series C has every fifth pose of theirs.
