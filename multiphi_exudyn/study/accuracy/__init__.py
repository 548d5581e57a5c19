"""How far answers can be trusted: parts of a difference, each with its cause and its own uncertainty."""
