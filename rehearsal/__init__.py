"""A world of its own for rehearsals: made-up readings of an arm with something hidden in it.

Nothing here knows of the packages that simulate, calibrate and diagnose: kinematics, statics, links and laws are
written a second time, and the laws of the truth are not those of the catalogue. Of ``robots`` it takes the description
as data, the array types and the one kind of error; a contract holds that.

- ``arm_of(description)``: any described arm as plain arrays;
- ``hide(arm, code, seed, ...)``: a world, its truth drawn; it makes readings, with noise and without;
- ``codes(arm)``: all that can be hidden in an arm;
- ``scoring``: what a diagnosis made of it, told as it is.
"""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from rehearsal.arm import Arm
    from rehearsal.described import arm_of
    from rehearsal.evaluate import Truth, exact
    from rehearsal.noise import Noise
    from rehearsal.possible import codes
    from rehearsal.readings import Readings
    from rehearsal.scoring import Outcome, family, outcome
    from rehearsal.world import World, hide
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "Arm",
    "Noise",
    "Outcome",
    "Readings",
    "Truth",
    "World",
    "arm_of",
    "codes",
    "exact",
    "family",
    "hide",
    "outcome",
]
