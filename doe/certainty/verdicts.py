"""From when on a diagnosis says something, whatever was read: priors, alarms and names."""

from __future__ import annotations

# Prior probabilities of nothing missing and of something that the catalogue does not know; the rest is shared by the
# families of effects that the readings can see, and within a family by its members.
PRIOR_NONE, PRIOR_UNKNOWN = 0.5, 0.05
# Below this probability of "nothing missing" there is something to explain.
ALARM = 0.12
# A name is sure from this share of the probability of all effects on.
NAME = 0.9
# A further effect needs this probability, of all but the unknown, and this log evidence: no law is quite right, and
# what is left of one looks like another.
FURTHER, GAIN = 0.9, 5.5
