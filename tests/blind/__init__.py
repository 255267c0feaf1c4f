"""The sets of the blind study: measurements of the bundled robots with a hidden effect, none, a stranger, or two.

The world that makes them is the package ``rehearsal``, which knows nothing of the packages under test.

- ``sets.make(spec, seed)``: one set, its table and model (for the workflow) and its key (for the study alone);
- ``sets.more(spec, seed, sheet)``: a proposed measurement sheet, filled in by the same hidden arm;
- ``sets.truth_at(spec, seed, sheet)``: the exact displacements at a sheet's rows, for held-out errors;
- ``study.suite(...)``: specs and seeds of a study; ``python -m tests.blind FOLDER`` writes them.

``SetSpec.from_dict(key["spec"])`` and ``key["seed"]`` bring a written set back.
"""
