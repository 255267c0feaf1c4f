"""Where is a milling robot stiff?
==================================

A KUKA KR60-3 reaches each point of a plane in many postures; the map uses the stiffest
angle about the tool axis. The colour is the force in newtons that pushes the tool down
by a millimetre.
"""

import stiffarm as sa

arm = sa.load("kr60-3")
plane = sa.map_slice(arm, plane="xz", step_mm=200, pose="best-gamma")
print(plane)
# Picture: the stiffness under a vertical load in the plane through the base, with the
# arm at its stiffest point. It is warm and stiff near the column, cold and soft at full
# reach.
plane.plot(file="where_is_it_stiff.png")

points = plane.to_frame().dropna()
most, least = points["stiffness_N_per_mm"].max(), points["stiffness_N_per_mm"].min()
print(f"Between {least:.0f} and {most:.0f} N/mm: {most / least:.0f} times as stiff")
stiffest = points.loc[points["stiffness_N_per_mm"].idxmax()]
assert most > 8 * least
assert (stiffest["x_mm"] ** 2 + stiffest["z_mm"] ** 2) ** 0.5 < 1200

# %%
# A robot has no single stiffness: it depends on the place, and near the column this arm
# is far stiffer than at full reach. The springs of this model are from a publication; a
# map of your own robot needs your own readings.
#
# Read on: :doc:`/how-to/maps`. In three dimensions: :doc:`a_map_in_paraview`.
