"""Parameters and noise estimated from readings."""
