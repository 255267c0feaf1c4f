"""What to measure next: rivals, what would tell them apart, and what that would come to."""
