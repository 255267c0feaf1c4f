"""Readings from a data frame: what a slip of the decimal point does, and who notices."""

import pandas as pd

import stiffarm as sa

arm = sa.load("xr701")
frame = pd.read_csv(sa.bundled("xr701"))
readings = sa.read_readings(frame, arm)
print(readings)
arm.plot("readings_from_a_frame.png", q_deg={"q2_deg": 5, "q3real_deg": 77.5})

frame["dz_mm"] = frame["dz_mm"] / 25.4  # typed in inches
try:
    sa.read_readings(frame, arm)
    noticed = False
except sa.InputError as error:
    print(error)
    noticed = True

assert noticed
