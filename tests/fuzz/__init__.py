"""The standing attack on everything that is read: ``python -m tests.fuzz``, or ``make fuzz``."""
