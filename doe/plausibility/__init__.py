"""Whether readings can be those of an arm: units, columns that stand still, readings that tell nothing."""
