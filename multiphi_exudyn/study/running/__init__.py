"""One run of one model of a scene: its histories and what it cost."""
