"""Which springs do nine poses identify?
========================================

A gauge read how far an ACMA XR701 deflects in nine poses, vertically only. Four springs
are free, and the readings decide which of them get a value.
"""

import numpy as np

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
cal = sa.calibrate(
    arm, readings, free=["j2.stiffness", "j3.stiffness", "j4.stiffness", "j5.stiffness"]
)
print(cal)

# Picture: the 95 % intervals of four springs on a logarithmic axis. Those of joints 2
# and 3 have two ends, those of joints 4 and 5 are open on the stiff side.
cal.plot(file="which_springs.png")

j3 = cal["j3.stiffness"]
half = 50 * (j3.interval95[1] - j3.interval95[0]) / j3.value
print(f"Joint 3: {j3.value:,.0f} N m/rad, known to ± {half:.0f} %")
closed = [p.name for p in cal.parameters if np.isfinite(p.interval95[1])]
assert closed == ["j2.stiffness", "j3.stiffness"]
assert half < 10

# %%
# Only joints 2 and 3 get an interval with both limits. Joint 4 has only a lower limit,
# and joint 5 is at its bound: vertical loads in these poses hardly turn the wrist, so
# the readings do not say how stiff it is. A fit without intervals would have printed
# four values, two of them meaningless.
#
# Read on: :doc:`/how-to/calibrate`, :doc:`/concepts/uncertainty`. Next: which poses
# would tell more, :doc:`what_to_measure_next`.
