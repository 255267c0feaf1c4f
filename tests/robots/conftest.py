"""Makes what lies beside it importable from the folders below."""
