"""Would we find a worn bearing?
================================

A rehearsal hides an effect in simulated readings of a planned campaign, diagnoses them
blind, and then shows the true effect. Here the bearing of joint 3 of a KUKA KR60-3
tilts, and twelve poses are planned.
"""

import stiffarm as sa

arm = sa.load("kr60-3", links="rigid")
rehearsal = sa.rehearse(arm, poses=12, hide="joint-tilt:j3")
print(rehearsal.answer)

# Picture: errors before and after the diagnosis, of the readings and of poses held out.
# After it, both are near the noise.
rehearsal.plot(file="would_we_find_it.png")

before, after = (1e3 * gap_mm for gap_mm in rehearsal.gaps_mm[0])
print(f"Named; error at unseen poses {before:.0f} um before, {after:.1f} um after")
assert rehearsal.outcomes == ("named",)
assert after < 0.1 * before

# %%
# The simulated robot shares no code with the diagnosis, so finding the effect is a real
# test. If a rehearsal ends in *unnamed* or *wrong*, plan other poses before you go to
# the robot.
#
# Read on: :doc:`/how-to/rehearse`. All effects at once: :doc:`what_would_they_show`.
