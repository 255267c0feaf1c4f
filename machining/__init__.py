"""Use: indices, posture, rail placement, toolpaths, NC programs (still to come)."""
