"""How sure an estimate is, and what the readings cannot tell apart."""
