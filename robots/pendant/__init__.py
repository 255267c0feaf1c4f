"""Positions read at the controller against the model's kinematics: whether they agree, and what is wrong if not."""
