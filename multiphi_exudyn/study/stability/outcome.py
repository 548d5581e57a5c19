"""Result of one model in one case: a row of the table."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FAILED", "NOT_RUN", "OK", "CaseResult", "Outcome"]

OK, FAILED, NOT_RUN = "ok", "failed", "not run"


@dataclass(frozen=True)
class Outcome:
    """Result of one model in one case. Quantities that a model does not have are None.

    model: its name. status: "ok" | "failed" | "not run"; message: the cause, or a remark. wrong: what makes an answer
    that is ok wrong (native model and user object), one sentence each.
    energy, residual, missed, beyond [m], excused [m], reported [m]: see judgement.py, beyond being the judged part and
    excused the part due to truncation. energy of an Exudyn model: its drift, where damped or loaded its largest gain.
    difference: to the native answer, ||y - native|| / ||native|| of the contacts' travel, the worst of them;
    agrees_until: the share of the run up to the first difference above AGREEMENT of the largest travel.
    warnings: of a reduced model about its result.
    steps: of an Exudyn model. samples, covered: of the brute force. time_s: of the run alone [s].
    """

    model: str
    status: str = OK
    message: str = ""
    wrong: tuple[str, ...] = ()
    energy: float | None = None
    residual: float | None = None
    events: int | None = None
    missed: int | None = None
    beyond: float | None = None
    excused: float | None = None
    reported: float | None = None
    difference: float | None = None
    agrees_until: float | None = None
    steps: int | None = None
    samples: int | None = None
    covered: float | None = None
    time_s: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class CaseResult:
    """name, hard: of the case; outcomes: one of every model."""

    name: str
    hard: str
    outcomes: tuple[Outcome, ...]

    @property
    def wrong(self) -> bool:
        """Whether one of the results is wrong."""
        return any(outcome.wrong for outcome in self.outcomes)

    @property
    def answered(self) -> bool:
        """Whether one of the runs is ok."""
        return any(outcome.status == OK for outcome in self.outcomes)
