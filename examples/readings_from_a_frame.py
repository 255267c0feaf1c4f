"""Does it notice wrong units?
==============================

Readings come as a table, a spreadsheet or a data frame, and sooner or later someone
enters inches. Here the same readings are given twice, once with deflections in inches
in a column named millimetres.
"""

import pandas as pd

import stiffarm as sa

arm = sa.load("xr701")
frame = pd.read_csv(sa.bundled("xr701"))
readings = sa.read_readings(frame, arm)
print(readings.title())
# Picture: the XR701 in one of its measured poses, with an arrow for the load at its
# tool.
arm.plot("readings_from_a_frame.png", q_deg={"q2_deg": 5, "q3real_deg": 77.5})

frame["dz_mm"] = frame["dz_mm"] / 25.4  # inches
try:
    sa.read_readings(frame, arm)
    refused = 0
except sa.InputError as error:
    print(error)
    refused = len(frame)

print(f"Refused: {refused} of {len(frame)} readings in wrong units")
assert refused == len(frame)

# %%
# An arm of this reach and payload cannot be as stiff as these values imply. The message
# names the units that would make sense of them. If the table is right as it is,
# `confirm_units` accepts it.
#
# Read on: :doc:`/how-to/read_readings`, :doc:`/reference/measurement_table`.
