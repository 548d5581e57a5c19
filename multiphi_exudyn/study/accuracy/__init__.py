"""Accuracy studies: many runs of one scene's models, and error against run time with the reason for every error."""
