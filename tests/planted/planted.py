"""Changes planted in a finished study, and whether the gate tells and explains each of them.

``tools/planted`` plants 200 changes and reruns a study 100 times with nothing changed; it goes on
where it was stopped if it is given the same ``--into``. Every answer is judged by what was planted
and by what differs between the tables, see ``judged.py``.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import changes
import judged
import unchanged
from changes import Change
from unchanged import Rerun
from worlds import SOURCE, World, finished, rerun, write_world

HERE = Path(__file__).resolve().parent
OTHER_RUN = {
    "seed": 5,
    "calibration": {"vec": {"order": 3}, "dh": {"truncation": 0.05}},
    "study": {"alpha": 0.5},
    "datasets": {"own": {"calibration": {"compliance": {"joints": [3]}}}},
}


class Trials:
    """A study with an accepted run, another run of it, and a tree of the package to be changed."""

    def __init__(self, folder: Path) -> None:
        """Make all that is not there yet."""
        self.folder = folder
        self.base, self.older = World(folder / "base"), World(folder / "older")
        if not (folder / "ready").exists():
            for each in ("base", "older", "tree"):
                shutil.rmtree(folder / each, ignore_errors=True)
            finished(self.base.folder).accept()
            older = write_world(self.older.folder)
            older.configure(OTHER_RUN)
            changes.noise(older, older, 0.1, 4)
            rerun(older.plan())
            shutil.copytree(SOURCE, folder / "tree" / "kinacc")
            (folder / "ready").touch()

    def trial(self, case: Change | Rerun) -> dict:
        """Carry a case out and judge what the gate says of it."""
        work = Path(tempfile.mkdtemp(dir=self.folder, prefix="work-"))
        began = _cpu_s()
        try:
            code = case.code if isinstance(case, Change) else None
            environment = case.environment if isinstance(case, Rerun) else None
            if code is not None or environment is not None:
                with self._tree(code) as path:
                    done = _in_a_process(self.folder, work, case, path, environment or {})
            else:
                done = _forked(lambda: self.asked(case, work), work / "said.json")
            if isinstance(case, Change):
                faults = self._judged(case, work, done)
            else:
                faults = _judged_unchanged(done, case.action != "fresh")
        finally:
            shutil.rmtree(work)
        found = {"name": case.name, "family": case.family, "faults": faults}
        return found | {"cpu_s": round(_cpu_s() - began, 2), "made": len(done.get("made", ()))}

    def asked(self, case: Change | Rerun, work: Path) -> dict:
        """What the gate says after a case, and which stages were run."""
        if isinstance(case, Rerun):
            world, made = unchanged.carried_out(case, self.base, work), []
        else:
            world = self.base.copied(work / "again")
            made = changes.carried_out(case, world, self.older, work)
        answer = world.gate()
        text = "" if answer.told is not None else answer.text
        return {"made": made, "code": answer.code, "told": answer.told, "text": text}

    def _judged(self, case: Change, work: Path, done: dict) -> list[str]:
        if broken := _broken(done):
            return broken
        after = work / "again" / "results"
        truth = judged.differing(self.base.results, after, case.random)
        touched = case.action in changes.AFTERWARDS
        answer = judged.Answer.of(done["told"], touched)
        faults = judged.faults_of(answer, truth, case.causes, touched, case.only)
        if case.family == changes.WORSE:
            faults += judged.faults_on_worse(answer, self.base.results, after)
        if case.family.endswith("no numbers") and judged.YES in truth.values():
            faults.append("the harness: numbers differ, and were not meant to")
        return faults

    @contextmanager
    def _tree(self, code: tuple[str, str, str] | None) -> Iterator[Path]:
        """The package's tree with one file changed, as it was again afterwards."""
        tree = self.folder / "tree"
        if code is None:
            yield SOURCE.parent
            return
        name, old, new = code
        path = tree / "kinacc" / name
        right = SOURCE / name  # a run that was killed leaves the tree changed
        before, times = right.read_text(), right.stat()
        try:
            path.write_text(before.replace(old, new, 1) if old else before + new)
            if old and old not in before:
                raise ValueError(f"{name} has no {old!r}")
            yield tree
        finally:
            path.write_text(before)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def _broken(done: dict) -> list[str]:
    if "error" in done:
        return [f"broke off: {done['error'].strip().splitlines()[-1]}"]
    if done["told"] is None or done["code"] not in (0, 1):
        return [f"no answer (exit code {done['code']}): {done['text'][:300]}"]
    return []


def _judged_unchanged(done: dict, whole: bool) -> list[str]:
    if broken := _broken(done):
        return broken
    answer, faults = judged.Answer.of(done["told"], whole), []
    if (whole and done["code"]) or answer.failed:
        faults.append(f"failed although nothing changed: {'; '.join(answer.failed)[:300]}")
    if answer.differences:
        names = {f"{each.dataset}/{each.artefact}" for each in answer.differences}
        faults.append(f"names {', '.join(sorted(names))[:200]} although nothing changed")
    if "changed" in answer.words.replace("nothing changed", "").replace("has changed", ""):
        faults.append(f"tells of a change: {answer.words[:200]}")
    return faults


def _cpu_s() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _forked(do: Callable[[], dict], said: Path) -> dict:
    """What a function returns in a process of its own, which has all modules already."""
    sys.stdout.flush()
    child = os.fork()
    if not child:
        try:
            _tell(do, said)
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    return json.loads(said.read_text())


def _in_a_process(
    folder: Path, work: Path, case: Change | Rerun, source: Path, environment: dict[str, str]
) -> dict:
    """What the gate says where the package is imported from a tree, beside other variables."""
    words = [sys.executable, str(HERE / "planted.py"), "--into", str(folder)]
    words += ["--only", case.name, "--said", str(work)]
    folders = [str(source), *(path for path in sys.path if path and "site-packages" not in path)]
    settings = os.environ | environment | {"PYTHONPATH": os.pathsep.join(folders)}
    done = subprocess.run(words, env=settings, capture_output=True, text=True, check=False)
    try:
        return json.loads((work / "said.json").read_text())
    except OSError:
        return {"error": done.stderr or "nothing said"}


def _tell(do: Callable[[], dict], said: Path) -> None:
    try:
        with warnings.catch_warnings(action="ignore"):
            found = do()
    except BaseException:
        found = {"error": traceback.format_exc()}
    said.write_text(json.dumps(found))


def cases() -> list[Change | Rerun]:
    """All that is planted and all reruns without a change, families in turn."""
    found: dict[str, list[Change | Rerun]] = {}
    for each in (*changes.everything(), *unchanged.everything()):
        found.setdefault(each.family, []).append(each)
    turns = [(place / len(own), each) for own in found.values() for place, each in enumerate(own)]
    return [each for _, each in sorted(turns, key=lambda turn: turn[0])]


def table(found: Sequence[dict]) -> Iterator[str]:
    """Lines: for each family how many are told and explained rightly, then each that is not."""
    yield f"{'what was changed':28}{'cases':>6}{'right':>7}{'CPU s':>8}"
    for family in dict.fromkeys(each["family"] for each in found):
        own = [each for each in found if each["family"] == family]
        right = sum(not each["faults"] for each in own)
        spent = sum(each["cpu_s"] for each in own)
        yield f"{family:28}{len(own):>6}{right:>7}{spent:>8.0f}"
    wrong = [each for each in found if each["faults"]]
    yield f"{len(found) - len(wrong)} of {len(found)} right"
    for each in wrong:
        yield f"- {each['name']}: {'; '.join(each['faults'])}"


def main() -> int:
    """Carry out what is not done yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path, default=Path(".planted"))
    parser.add_argument("--only", help="cases whose names begin so, or have it after a ~")
    parser.add_argument("--anew", action="store_true", help="cases that were wrong, once more")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--said", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    folder, only = given.into.resolve(), given.only or ""
    if given.said:
        (case,) = [each for each in cases() if each.name == only]
        trials = Trials(folder)
        _tell(lambda: trials.asked(case, given.said), given.said / "said.json")
        return 0
    journal = folder / "found.jsonl"
    trials = Trials(folder)
    known = {}
    if journal.exists():
        known = {each["name"]: each for each in map(json.loads, journal.read_text().splitlines())}
    began = time.monotonic()
    for case in cases():
        before = known.get(case.name)
        chosen = only[1:] in case.name if only.startswith("~") else case.name.startswith(only)
        if not chosen or (before and not (given.anew and before["faults"])):
            continue
        if time.monotonic() - began > 60 * given.minutes:
            break
        known[case.name] = trials.trial(case)
        with journal.open("a") as file:
            file.write(json.dumps(known[case.name]) + "\n")
        if known[case.name]["faults"]:
            print(f"{case.name}: {'; '.join(known[case.name]['faults'])}", flush=True)
    print(*table([known[each.name] for each in cases() if each.name in known]), sep="\n")
    return 1 if any(each["faults"] for each in known.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
