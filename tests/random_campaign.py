"""A long campaign of random cases: ``python tests/random_campaign.py --count 100000 --processes 2``.

Case by case, each from its number alone (strategies.py): no exception but a named one, what must hold of every run
(run_checks.py), and the same motion from both loops; events of a contact on which nothing presses may differ. Finished
chunks stand in a file, so that a campaign that was stopped goes on where it was; the summary names every failing case
with its cause.
"""

import argparse
import collections
import json
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np
from run_checks import complaints
from strategies import built, recipe_of

from multiphi_exudyn import MultiPhiError, simulate
from multiphi_exudyn.study.sweep.time_limit import TimeLimitExceeded, call_within

CHUNK = 100  # cases written at a time
NEAR = 1e-6  # of the largest displacement: the two loops' motions
LONGEST = 900.0  # s: most cases take a tenth of a second, the first one compiles; a run may never end
NUDGE = 1e-12  # of the start, more than is cleared on a stop: a run it changes by over NEAR is sensitive, not wrong
INSTANTS = 40  # at which two runs are compared


def verdicts(number):
    """What is to be said of a case, each (kind, cause); kinds that are not "failure: ..." are counted only."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return call_within(LONGEST, lambda: _verdicts(number))
    except MultiPhiError as error:
        return [("refused", str(error))]
    except TimeLimitExceeded:
        return [("failure: endless", f"not finished after {LONGEST:g} s")]
    except Exception as error:
        return [("failure: exception", f"{type(error).__name__}: {error}")]


def _verdicts(number):
    case = built(recipe_of(number))
    first, second = (_run(case, compiled) for compiled in (False, None))
    if first.message and "chatter" in first.message:  # a named failure of a run that need not have failed
        return [("chatter", first.message)]
    found = [(f"failure: {text.split(':')[0]}", text) for text in complaints(first)]
    if not _same(first, second):
        found.append(_difference(case, first, second))
    return found or [("ok" if first.status == "ok" else "named failure", first.message)]


def _run(case, compiled):
    start = {"displacement": case.displacement, "velocity": case.velocity}
    return simulate(case.model, case.t_end, **start, loads=case.loads, compiled=compiled)


def nudged(case, run, share):
    """The case with another start, by a share of it; where that is zero, by a share of the speeds of its run."""
    if np.any(case.displacement) or np.any(case.velocity):
        factor = 1 + share
        return replace(case, displacement=factor * case.displacement, velocity=factor * case.velocity)
    speed = float(np.max(np.abs(run.velocity(np.linspace(0, run.t_end, INSTANTS)))))
    return replace(case, velocity=share * speed * (-1.0) ** np.arange(len(case.velocity)))


def _same(first, second):
    """Same status, same motion."""
    if first.status != second.status or bool(first.segments) != bool(second.segments):
        return False
    if not first.segments:
        return True
    t = np.linspace(0, min(first.t_end, second.t_end), INSTANTS)
    places = [run.displacement(t) for run in (first, second)]
    return bool(np.max(np.abs(places[0] - places[1])) <= NEAR * np.max(np.abs(places)))


def _difference(case, first, second):
    """Whether the loops differ where every two runs do."""
    if not all(_same(first, _run(nudged(case, first, sign * NUDGE), False)) for sign in (1, -1)):
        return "sensitive", "a nudged start changes the answer as much"
    return "failure: loops", f"{first.status} {len(first.events)} events, {second.status} {len(second.events)}"


def chunk(first, last):
    """Verdicts of the cases first, first + 1, ... last - 1: counts, and what failed."""
    counts, failed = collections.Counter(), []
    for number in range(first, last):
        for kind, cause in verdicts(number):
            counts[kind] += 1
            if kind.startswith("failure"):
                failed.append([number, kind, cause[:300]])
    return {"first": first, "last": last, "counts": counts, "failed": failed}


def main(arguments=None):
    """Exit code 0 where nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("random-campaign.jsonl"), help="finished chunks, one a line")
    given = parser.parse_args(arguments)
    done = _finished(given.out)
    spans = [
        (k, min(k + CHUNK, given.first + given.count)) for k in range(given.first, given.first + given.count, CHUNK)
    ]
    started = time.perf_counter()
    with given.out.open("a", encoding="utf-8") as file, ProcessPoolExecutor(given.processes) as pool:
        waiting = [pool.submit(chunk, *span) for span in spans if span not in done]
        for future in as_completed(waiting):
            result = future.result()
            done[result["first"], result["last"]] = result
            print(json.dumps(result), file=file, flush=True)
    return _summary([done[span] for span in spans], time.perf_counter() - started)


def _finished(path):
    """Chunks of an earlier part of the campaign; a line that a stop cut short is none."""
    found = {}
    for line in path.read_text("utf-8").splitlines() if path.exists() else ():
        if line.endswith("}"):
            result = json.loads(line)
            found[result["first"], result["last"]] = result
    return found


def _summary(results, seconds):
    counts, failed = collections.Counter(), []
    for result in results:
        counts.update(result["counts"])
        failed += result["failed"]
    print(f"{sum(result['last'] - result['first'] for result in results)} cases, {seconds:.0f} s in this part")
    for kind, count in counts.most_common():
        print(f"{count:8d}  {kind}")
    for number, kind, cause in sorted(failed):
        print(f"{number}  {kind}: {cause}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
