"""`calibrate` on tables of absolute positions."""
