"""The same statics as compiled loops over poses."""
