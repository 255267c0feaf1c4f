"""What a diagnosis found, as it is shown: numbers with intervals, laws as curves, traces in the readings."""
