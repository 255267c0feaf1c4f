"""What to measure next: designs, screening, optimal choice."""
