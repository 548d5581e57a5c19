"""A scene: its file, what it means as mechanics, and the bench on which its models are built."""
