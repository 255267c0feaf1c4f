"""What would eight poses show?
===============================

Before anyone measures: of six possible faults of a KUKA KR60-3, which would eight poses
find, and which would they name? Each is drawn several times in its usual size.
"""

import stiffarm as sa

arm = sa.load("kr60-3", links="rigid")
suspects = ["tool-compliance", "joint-tilt:j3", "payload"]
suspects += ["backlash:j2", "friction:j2", "gauge-scale"]
seen = sa.rehearse(arm, poses=8, effects=suspects, one_more=False, draws=8)
table = seen.to_frame()[["effect", "found_percent", "named_percent", "twin"]]
print(table.round(0).to_string(index=False))

# Picture: of six effects the chance to be found and the chance to be named, with
# intervals. The scale error of the gauge is found in hardly any draw.
seen.plot(file="what_would_they_show.png")

certain = list(table["effect"][table["found_percent"] > 80.0])
print(f"{len(certain)} of {len(suspects)} effects would be found with more than 80 %")
assert "gauge-scale" not in certain
assert len(certain) == len(suspects) - 1

# %%
# A gauge that reads slightly too much looks like springs that are slightly too soft: no
# poses separate the two, only a check of the gauge does. Backlash and friction would be
# seen but probably not named; the last column says what they would be mistaken for.
#
# Read on: :doc:`/how-to/rehearse`, :doc:`/validation/forecasts`. Next:
# :doc:`what_to_measure_next`.
