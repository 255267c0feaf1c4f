"""Measurements with a hidden effect, made by mechanics of their own.

Nothing here imports the packages under test: kinematics, statics, links and laws are written a second time, and
the laws of the truth are not those of the catalogue.

- ``sets.make(spec, seed)``: one set, its table and model (for the workflow) and its key (for the study alone);
- ``sets.more(spec, seed, sheet)``: a proposed measurement sheet, filled in by the same hidden arm;
- ``sets.truth_at(spec, seed, sheet)``: the exact displacements at a sheet's rows, for held-out errors;
- ``study.suite(...)``: specs and seeds of a study; ``python -m tests.blind FOLDER`` writes them.

``SetSpec.from_dict(key["spec"])`` and ``key["seed"]`` bring a written set back.
"""
