"""Maps of a machining index over a plane or a box."""
