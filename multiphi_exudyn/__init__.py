"""Multi-Phi: structures with contacts as piecewise-linear modal models, exact in time between events.

A structure (M, C, K, named points) and its contacts have levels, one for each set of closed contacts, with modes and an
asymptotic configuration; transitions transfer the motion from one level to another.

The public names are in public.py. They are loaded with the first access, so that programs without them, such as the
help of the command line, start at once.

Every room imports only from rooms before it in this order, and so do the files of a room.

Order: errors, version, display, files, mathematics, mechanics, levels, time, steady, public, exudyn_plugin,
study, cli, __main__.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multiphi_exudyn.public import *  # noqa: F403  its __all__ says which
else:

    def __getattr__(name: str) -> Any:
        """A public name, or a room, that is not loaded yet."""
        import multiphi_exudyn.public as public

        globals().update({each: getattr(public, each) for each in public.__all__}, __all__=public.__all__)
        if name not in globals():
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return globals()[name]

    def __dir__() -> list[str]:
        return sorted({*globals(), *__getattr__("__all__")})
