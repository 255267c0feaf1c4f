"""Where in the plane through its base is a milling robot stiff?"""

import numpy as np

import stiffarm as sa

arm = sa.load("kr60-3")
m = sa.map_slice(arm, plane="xz", step_mm=200, pose="best-gamma")
print(m)
m.plot("where_is_it_stiff.png")
m.save("where_is_it_stiff.vti")

points = m.points().dropna()
stiffest = points.loc[points["stiffness_N_per_mm"].idxmax()]
print(f"stiffest at x = {stiffest['x_mm']:.0f} mm, z = {stiffest['z_mm']:.0f} mm")
assert np.hypot(stiffest["x_mm"], stiffest["z_mm"]) < 2500
assert stiffest["stiffness_N_per_mm"] > 3 * points["stiffness_N_per_mm"].median()
