"""Where simulation and measurement disagree, and which physical effect explains it."""
