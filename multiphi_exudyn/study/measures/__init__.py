"""How two answers differ: every measure in one place."""
