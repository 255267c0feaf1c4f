"""Surface files of links: read, repaired or wrapped, remeshed, moved to the mid-surface."""
