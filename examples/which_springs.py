"""Which springs do nine poses of readings identify?"""

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
cal = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness", "j4.stiffness", "j5.stiffness"])
print(cal)
cal.plot("which_springs.png")

low, high = cal["j3.stiffness"].interval95
assert low < cal["j3.stiffness"].value < high
assert cal.identified + cal.at_bound <= cal.free == 4
