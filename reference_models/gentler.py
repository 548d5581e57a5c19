"""Gentler settings for a full beam that fails at its own: a short ladder, each rung with all of those before it.

    full Newton; half the step; ten times the Newton tolerance; spectral radius 0.9

A full Newton iteration follows a contact that closes inside a step; half the step halves what it has to follow; a lax
tolerance lies above a round-off floor that a tight one cannot reach; a radius below 1 damps what the step does not
resolve. A run that gains energy is a failure on every rung, so that none of them can pass for a better one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from reference_models.full_beam import FullBeam
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.full_run import FullRun

__all__ = ["Attempt", "attempts", "gentler"]

STEP_SHARE = 0.5
TOLERANCE_FACTOR = 10.0
SPECTRAL_RADIUS = 0.9


@dataclass(frozen=True)
class Attempt:
    """settings: in words, "as asked" for the first. run: what came out."""

    settings: str
    run: FullRun

    @property
    def told(self) -> str:
        """The attempt in one clause: settings, cause and time."""
        return f"{self.settings}: {self.run.message or 'ok'} ({self.run.online_s:.2g} s)"


def gentler(settings: FullBeamSettings) -> Iterator[tuple[str, FullBeamSettings]]:
    """The rungs in words and as settings; those that change nothing are left out."""
    changes = (
        ("full Newton", {"full_newton": True}),
        ("half the step", {"step": STEP_SHARE * settings.step}),
        ("ten times the Newton tolerance", {"newton_tolerance": TOLERANCE_FACTOR * settings.newton_tolerance}),
        (f"spectral radius {SPECTRAL_RADIUS:g}", {"spectral_radius": min(SPECTRAL_RADIUS, settings.spectral_radius)}),
    )
    words: list[str] = []
    for word, change in changes:
        changed = replace(settings, **change)
        if changed != settings:
            settings = changed
            words.append(word)
            yield ", ".join(words), settings


def attempts(beam: FullBeam, run: Callable[[FullBeam], FullRun]) -> list[Attempt]:
    """``run`` at the beam's own settings and, as long as it fails, at gentler ones; the last one is what counts.

    A static start that is not found is not tried again: none of the settings concern it.
    """
    done = [Attempt("as asked", run(beam))]
    for words, settings in gentler(beam.settings):
        last = done[-1].run
        if last.status == "ok" or last.balance is None:
            break
        done.append(Attempt(words, run(beam.with_settings(settings))))
    return done
