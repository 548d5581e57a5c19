"""The package's version, as it is installed."""

from importlib.metadata import PackageNotFoundError, version

__all__ = ["__version__"]

try:
    __version__ = version("multiphi-exudyn")
except PackageNotFoundError:  # a source tree on the path that was never installed
    __version__ = "unknown"
