"""A long campaign of random cases.

    python tests/campaign/random_campaign.py --kinds all --count 20000 --processes 2

Case by case, each from its kind and number alone: no exception but a named one, and what must hold of every run
(study/law_check.py). All kinds (campaign_scenes) but "plain" and "lattice"
are judged by brute force (campaign_judge.py). With ``--kernels Prescott,Haswell`` the same cases run under each of
these kernels of the linear algebra library, each in its own process, and their statuses, numbers of events and answers
are compared.

Kinds with dry friction: a slider alone, blocks, springs in series ("jenkins"), of all laws under several loads, beside
contacts that give way, beside rigid ones ("friction impacts"), on bodies that nothing else holds, at rest exactly at
their limits, in other units, and contacts that rub in proportion to their forces ("contact friction"). The energy that
friction takes is compared too.

"lattice": small integers and zeros, equal places, coinciding events, all elements together, judged by the law check
alone (study/law_check.py): ``--kinds lattice --count 20000``.

Finished chunks stand in a file, so that a campaign that was stopped goes on where it was; the summary names every
failing case with its cause. A case alone: ``--kinds viscous --first 17 --count 1``.
"""

import argparse
import collections
import json
import os
import subprocess
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # a plain checkout
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "helpers"))

import campaign_judge
import numpy as np
import threadpoolctl
from campaign_scenes import KINDS, numbers, scene_of

from multiphi_exudyn import MultiPhiError, MultiPhiWarning
from multiphi_exudyn.study.sweep import TimeLimitExceeded, call_within
from reference_models.exudyn_quiet import quiet

CHUNK = 100  # cases written at a time
LONGEST = 900.0  # s: most cases take a tenth of a second; a run may never end
NEAR = 1e-6  # of the largest displacement: the answers under two kernels

OWN_NAMES = {"Prescott": {"Katmai", "Prescott", "Nehalem"}}  # what OpenBLAS calls the kernels that were asked for


def judged(kind, number):
    """(verdicts, digest) of a case: verdicts (kind, cause), of which failures have a kind "failure: ..."; the digest is
    what every processor must agree on.
    """
    digests = []

    def judge():
        with quiet():
            found, digest = campaign_judge.judged(scene_of(kind, number))
        digests.append(digest)
        return found

    found = _named(judge)
    return found, digests[0] if digests else [found[0][0], 0, []]


def _named(judge):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", MultiPhiWarning)
            return call_within(LONGEST, judge)
    except MultiPhiError as error:
        return [("refused", str(error))]
    except TimeLimitExceeded:
        return [("failure: endless", f"not finished after {LONGEST:g} s")]
    except Exception as error:
        return [("failure: exception", f"{type(error).__name__}: {' '.join(str(error).split())}")]


def chunk(cases):
    """Verdicts of these cases, (kind, number) each: counts of every kind, what is not ok, and digests."""
    counts, notable, digests, started = collections.Counter(), [], {}, time.process_time()
    for kind, number in cases:
        found, digests[f"{kind}/{number}"] = judged(kind, number)
        for verdict, cause in found:
            counts[f"{kind}/{verdict}"] += 1
            if verdict != "ok":
                notable.append([kind, number, verdict, cause[:300]])
    seconds = time.process_time() - started
    return {
        "cases": [list(case) for case in cases],
        "seconds": seconds,
        "counts": counts,
        "notable": notable,
        "digests": digests,
    }


def main(arguments=None):
    """Exit code 0 where nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000, help="cases, spread evenly over kinds")
    parser.add_argument("--first", type=int, default=0, help="number of the first case of every kind")
    parser.add_argument("--kinds", default="plain", help=f"all, or some of {', '.join(KINDS)}")
    parser.add_argument("--kernels", default="", help="OpenBLAS kernels to run under, e.g. Prescott,Haswell,SkylakeX")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("random-campaign.jsonl"), help="finished chunks, one a line")
    given = parser.parse_args(arguments)
    if given.kernels:
        return _under_kernels(given)
    asked = os.environ.get("OPENBLAS_CORETYPE")
    if asked and kernel() not in OWN_NAMES.get(asked, {asked}):
        parser.error(f"OPENBLAS_CORETYPE: got {asked}, the library runs {kernel()}: this processor has no such kernel")
    kinds = KINDS if given.kinds == "all" else tuple(given.kinds.split(","))
    if unknown := set(kinds) - set(KINDS):
        parser.error(f"--kinds: got {', '.join(sorted(unknown))}, need some of {', '.join(KINDS)}")
    return _campaign(numbers(kinds, given.first, given.count), given)


def _campaign(cases, given):
    done = _finished(given.out)
    parts = [cases[k : k + CHUNK] for k in range(0, len(cases), CHUNK)]
    started = time.perf_counter()
    with given.out.open("a", encoding="utf-8") as file, ProcessPoolExecutor(given.processes) as pool:
        waiting = [pool.submit(chunk, part) for part in parts if _key(part) not in done]
        for future in as_completed(waiting):
            result = future.result()
            file.write(json.dumps(result) + "\n")
            file.flush()
            done[_key(result["cases"])] = result
    return _summary([done[_key(part)] for part in parts], time.perf_counter() - started)


def kernel():
    """Name of the kernels that NumPy's linear algebra runs."""
    found = (info for info in threadpoolctl.threadpool_info() if info.get("internal_api") == "openblas")
    return next((info["architecture"] for info in found), "unknown")


def _key(cases):
    return json.dumps([list(case) for case in cases])


def _finished(path):
    """Chunks of an earlier part of the campaign; a line that a stop cut short is none."""
    found = {}
    for line in path.read_text("utf-8").splitlines() if path.exists() else ():
        if line.endswith("}"):
            result = json.loads(line)
            found[_key(result["cases"])] = result
    return found


def _summary(results, seconds):
    counts, notable = collections.Counter(), []
    for result in results:
        counts.update(result["counts"])
        notable += result["notable"]
    spent = sum(result["seconds"] for result in results)
    total = sum(len(result["cases"]) for result in results)
    print(
        f"{total} cases, {seconds:.0f} s in this part, {spent / max(total, 1):.3f} s of CPU each ({kernel()} kernels)"
    )
    for kind in dict.fromkeys(key.split("/")[0] for key in sorted(counts)):
        own = {key.split("/")[1]: count for key, count in counts.items() if key.split("/")[0] == kind}
        print(f"{kind:18s}" + "  ".join(f"{verdict} {count}" for verdict, count in sorted(own.items())))
    for kind, number, verdict, cause in sorted(notable):
        if verdict != "sensitive":
            print(f"{kind} {number}  {verdict}: {cause}")
    return 1 if any(verdict.startswith("failure") for _, _, verdict, _ in notable) else 0


# ---------------------------------------------------------------------- several kernels


def _under_kernels(given):
    """The same campaign once for every kernel, and what differs between them."""
    codes, found = [], {}
    for name in given.kernels.split(","):
        out = given.out.with_suffix(f".{name}{given.out.suffix}")
        command = [sys.executable, __file__, "--kinds", given.kinds, "--out", str(out)]
        for option in ("count", "first", "processes"):
            command += [f"--{option}", str(getattr(given, option))]
        codes.append(subprocess.run(command, env=os.environ | {"OPENBLAS_CORETYPE": name}, check=False).returncode)
        if codes[-1] not in (0, 1):
            return codes[-1]
        found[name] = {key: value for part in _finished(out).values() for key, value in part["digests"].items()}
    different = differences(found)
    print(f"{len(next(iter(found.values())))} cases under {', '.join(found)}: {len(different)} differ")
    for line in different:
        print(line)
    failed = any("sensitive" not in line for line in different)
    return max(*codes, int(failed))


def differences(found):
    """Sentences about cases whose statuses, numbers of events or answers differ; found: {kernel: {case: digest}}."""
    (first, expected), *others = found.items()
    lines = []
    for name, digests in others:
        for case in sorted(set(expected) & set(digests)):
            if text := _differs(expected[case], digests[case]):
                kind, number = case.split("/")
                if kind == "at events" and not text.startswith(("status", "answers")):
                    continue  # its start is an instant of a run: round-off decides whether its event is still to come
                excuse = "" if text.startswith("status") else _excuse(kind, int(number))
                lines.append(f"{kind} {number}  {first} and {name}: {text}{excuse}")
    return lines


def _differs(one, other):
    if not one:
        return ""
    if one[0] != other[0]:
        return f"status {one[0]}, {other[0]}"
    values = [np.array(digest[2]) for digest in (one, other)]
    count = min(map(len, values))
    off = np.max(np.abs(values[0][:count] - values[1][:count]), initial=0.0)
    size = max(np.max(np.abs(values[0]), initial=0.0), 1e-300)
    if off > NEAR * size:
        return f"answers {off / size:.3g} apart, {one[1]} and {other[1]} events"
    return f"{one[1]} and {other[1]} events" if one[1] != other[1] else ""


def _excuse(kind, number):
    """Whether a nudged run drifts away as well."""
    scene = scene_of(kind, number)
    motion = campaign_judge.native(scene)
    return " (sensitive)" if campaign_judge.sensitive(scene, motion, campaign_judge.INSTANTS) else ""


if __name__ == "__main__":
    sys.exit(main())
