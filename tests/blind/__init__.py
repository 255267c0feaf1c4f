"""Measurements with a hidden effect, made by mechanics of their own.

Nothing here imports the packages under test: kinematics, statics, links and laws are written a second time, and
the laws of the truth are not those of the catalogue. ``sets.make`` makes one set, ``sets.more`` measures
further poses with the same truth, ``sets.suite`` yields the specs of a whole study, and
``python -m tests.blind`` writes them to a folder.
"""
