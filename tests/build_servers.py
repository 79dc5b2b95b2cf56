"""Build servers, as far as the recipes of examples/ci ask for them: steps run, folders kept.

What is run is the text of the recipe. What a server would do is done with folders of this machine:
a cache is a copy of its paths, an upload as well. ``python3 -m venv`` makes a folder whose
``kinacc`` is the one under test, and its ``pip`` writes down what it was asked for.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

RECIPES = Path(__file__).resolve().parents[1] / "examples" / "ci"
_VENV = """\
#!/bin/sh
if [ "$1 $2" = "-m venv" ]; then
  for folder; do :; done
  mkdir -p "$folder/bin"
  cp {pip} "$folder/bin/python"
  cp {kinacc} "$folder/bin/kinacc"
else
  exec {python} "$@"
fi
"""
_PIP = """\
#!/bin/sh
case "$2" in
  pip) echo "$@" >> {asked} ;;
  kinacc.workflow.warm_up) ;;
  *) exec {python} "$@" ;;
esac
"""


@dataclass(frozen=True)
class Ended:
    """How a pipeline ended: whether it passed, what it printed, what it left for people."""

    passed: bool
    text: str
    left: Path

    @property
    def jobs(self) -> list[tuple[str, bool]]:
        """What each stage said, and whether it was taken from Snakemake's shared cache."""
        said = re.split(r"^Job \d+: (?=\w+: )", self.text, flags=re.MULTILINE)[1:]
        # What is computed is moved to the cache first, and linked then.
        return [(job, "from cache." in job and "Moving output file" not in job) for job in said]

    @property
    def computed(self) -> list[str]:
        """The stages that were computed."""
        return [job.partition("\n")[0] for job, taken in self.jobs if not taken]

    @property
    def taken(self) -> set[str]:
        """Tables that were taken from Snakemake's shared cache."""
        tables = re.compile(r"Symlinking output file \S.*/(\w+).parquet from cache")
        return {name for job, taken in self.jobs if taken for name in tables.findall(job)}


@dataclass
class Server:
    """One machine for pipelines of one repository; ``kinacc`` is what the command starts."""

    folder: Path
    repository: Path
    kinacc: Path
    environment: Mapping[str, str]
    caches: list[tuple[str, tuple[str, ...], Path]] = field(default_factory=list)
    runs: int = 0

    def __post_init__(self) -> None:
        commands = self.folder / "commands"
        commands.mkdir(parents=True)
        python, asked = (shlex.quote(str(each)) for each in (sys.executable, self.asked))
        for name, text in {
            "pip": _PIP.format(python=python, asked=asked),
            "kinacc": f'#!/bin/sh\nexec {shlex.quote(str(self.kinacc))} "$@"\n',
            "python3": _VENV.format(
                python=python,
                pip=shlex.quote(str(commands / "pip")),
                kinacc=shlex.quote(str(commands / "kinacc")),
            ),
        }.items():
            (commands / name).write_text(text)
            (commands / name).chmod(0o755)

    @property
    def asked(self) -> Path:
        """What pip was asked for, a line each time."""
        return self.folder / "asked of pip"

    def run(self, command: list[str], where: Path, **more: str) -> subprocess.CompletedProcess[str]:
        """A command of a recipe, with the commands of this machine before all others."""
        path = f"{self.folder / 'commands'}:{os.environ['PATH']}"
        return subprocess.run(
            command,
            cwd=where,
            env={**os.environ, **self.environment, "PATH": path, "CI": "true", **more},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

    def cloned(self) -> tuple[Path, Path]:
        """A fresh clone, always in the same place, and a new folder for what is left of the run."""
        self.runs += 1
        clone, left = self.folder / "work", self.folder / f"left {self.runs}"
        shutil.rmtree(clone, ignore_errors=True)
        subprocess.run(["git", "clone", "-q", self.repository, clone], check=True)
        left.mkdir()
        return clone, left

    def keep(self, key: str, paths: tuple[str, ...], clone: Path) -> None:
        """Save paths of a clone under a key."""
        place = self.folder / f"cache {len(self.caches)}"
        for number, path in enumerate(paths):
            _copy(clone / path, place / str(number))
        self.caches.append((key, paths, place))

    def restore(
        self, fits: Callable[[str], bool], paths: tuple[str, ...], clone: Path
    ) -> str | None:
        """Put the newest copy back whose key fits; its key."""
        for key, theirs, place in reversed(self.caches):
            if theirs == paths and fits(key):
                for number, path in enumerate(paths):
                    _copy(place / str(number), clone / path)
                return key
        return None


def on_github(server: Server, event: str = "push", **env: str) -> Ended:
    """A run of examples/ci/github.yml; ``env`` replaces what stands in its section env."""
    recipe = yaml.safe_load((RECIPES / "github.yml").read_text())
    clone, left = server.cloned()
    settings = {key: str(value) for key, value in (recipe["env"] | env).items()}
    settings |= {"GITHUB_ACTIONS": "true"}
    files = {name: left / name for name in ("GITHUB_ENV", "GITHUB_STEP_SUMMARY")}
    known = {
        "github.workspace": str(clone),
        "github.event_name": event,
        "github.run_id": str(server.runs),
        "github.run_attempt": "1",
        **{f"env.{key}": value for key, value in settings.items()},
    }

    def value(expression: str) -> str:
        if listed := re.fullmatch(r"hashFiles\((.*)\)", expression):
            return _hashed(clone, re.findall("'(.*?)'", listed[1]))
        step = expression.startswith("steps.")
        return known.get(expression, "") if step else known[expression]

    def filled(text: str) -> str:
        return re.sub(r"\$\{\{ (.*?) \}\}", lambda found: value(found[1]), text)

    def holds(condition: str) -> bool:
        for part in condition.split(" && "):
            if part in ("always()", "success()"):
                continue
            left_side, sign, right = re.fullmatch(r"(.*) (==|!=) '(.*)'", part).groups()
            if (value(left_side) == right) != (sign == "=="):
                return False
        return True

    passed, said = True, []
    (job,) = recipe["jobs"].values()
    for step in job["steps"]:
        condition = step.get("if", "success()")
        if not holds(condition) or not (passed or "always()" in condition):
            continue
        if "run" in step:
            for name, path in files.items():
                path.touch()
                settings[name] = str(path)
            done = server.run(["bash", "-e", "-c", filled(step["run"])], clone, **settings)
            settings |= dict(line.split("=", 1) for line in _lines(files["GITHUB_ENV"]))
            said.append(done.stdout)
            passed = passed and done.returncode == 0
            continue
        given = {key: filled(str(text)) for key, text in step.get("with", {}).items()}
        paths = tuple(given.get("path", "").splitlines())
        outputs = f"steps.{step.get('id')}.outputs."
        match step["uses"].partition("@v")[0]:
            case "actions/checkout":
                pass
            case "actions/setup-python":
                known[outputs + "python-version"] = f"{given['python-version']}.0"
            case "actions/cache/restore":
                starts = tuple(given.get("restore-keys", "").splitlines())
                exact = given["key"]
                found = server.restore(exact.__eq__, paths, clone) or (
                    server.restore(lambda key, them=starts: key.startswith(them), paths, clone)
                    if starts
                    else None
                )
                known[outputs + "cache-hit"] = str(found == exact).lower() if found else ""
                known[outputs + "cache-primary-key"] = exact
            case "actions/cache/save":
                assert given["key"] not in [key for key, *_ in server.caches], "keys are kept"
                server.keep(given["key"], paths, clone)
            case "actions/upload-artifact":
                _upload(clone, paths, left)
            case other:
                raise AssertionError(f"what does {other} do?")
    return Ended(passed, "".join(said), left)


def on_gitlab(server: Server, merge_request: bool = False, **variables: str) -> Ended:
    """A run of examples/ci/gitlab-ci.yml; ``variables`` replace what stands there."""
    recipe = yaml.safe_load((RECIPES / "gitlab-ci.yml").read_text())
    clone, left = server.cloned()
    branch = {"CI_MERGE_REQUEST_IID": "1"} if merge_request else {"CI_COMMIT_BRANCH": "main"}
    settings = {
        "GITLAB_CI": "true",
        "CI_PROJECT_DIR": str(clone),
        "CI_PIPELINE_SOURCE": "merge_request_event" if merge_request else "push",
        "CI_COMMIT_REF_SLUG": "theirs" if merge_request else "main",
        "CI_DEFAULT_BRANCH": "main",
        **branch,
        **recipe["variables"],
    }
    first = next(rule for rule in recipe["workflow"]["rules"] if _applies(rule["if"], settings))
    assert first.get("when") != "never"
    settings |= first.get("variables", {}) | variables
    job = recipe["kinacc"]

    def filled(text: str) -> str:
        return re.sub(r"\$(\w+)", lambda found: settings[found[1]], text)

    def key_of(cache: Mapping) -> str:
        if isinstance(cache["key"], str):
            return filled(cache["key"])
        return f"{filled(cache['key']['prefix'])}-{_hashed(clone, cache['key']['files'])}"

    for cache in job["cache"]:
        for key in (key_of(cache), *map(filled, cache.get("fallback_keys", ()))):
            if server.restore(key.__eq__, tuple(cache["paths"]), clone):
                break
    done = server.run(_script(job["before_script"] + job["script"]), clone, **settings)
    server.run(_script(job["after_script"]), clone, **settings)
    passed = done.returncode == 0
    for cache in job["cache"]:
        if "push" in filled(cache["policy"]) and (passed or cache.get("when") == "always"):
            server.keep(key_of(cache), tuple(cache["paths"]), clone)
    assert job["artifacts"]["when"] == "always"
    _upload(clone, tuple(job["artifacts"]["paths"] + [*job["artifacts"]["reports"].values()]), left)
    return Ended(passed, done.stdout, left)


def on_one_machine(server: Server, commit: str = "main", **settings: str) -> Ended:
    """A run of examples/ci/pipeline.sh, which keeps everything itself."""
    kept = server.folder / "kept"
    command = ["git", "-C", str(server.repository), "rev-parse", commit]
    digest = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
    words = ["sh", str(RECIPES / "pipeline.sh"), str(server.repository), digest]
    done = server.run(words, server.folder, KEPT=str(kept), **settings)
    return Ended(done.returncode == 0, done.stdout, kept / "runs" / digest)


def _script(lines: list[str]) -> list[str]:
    return ["bash", "-eo", "pipefail", "-c", "\n".join(lines)]


def _applies(rule: str, settings: Mapping[str, str]) -> bool:
    for part in rule.split(" && "):
        name, _, wanted = part.removeprefix("$").partition(" == ")
        found = settings.get(name, "")
        if not found or (wanted and found != wanted.strip('"')):
            return False
    return True


def _lines(path: Path) -> list[str]:
    return path.read_text().splitlines()


def _hashed(clone: Path, patterns: list[str]) -> str:
    files = sorted(path for pattern in patterns for path in clone.glob(pattern))
    if not files:
        return ""
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def _copy(source: Path, target: Path) -> None:
    """A copy with the times of files and with links as they are, as archives have them."""
    if source.is_dir():
        shutil.copytree(source, target, symlinks=True, dirs_exist_ok=True)


def _upload(clone: Path, paths: tuple[str, ...], left: Path) -> None:
    """Copy files for people; links are followed, hidden files left out."""
    for pattern in paths:
        for found in map(Path, glob.glob(str(clone / pattern))):
            if found.is_dir():
                shutil.copytree(
                    found,
                    left / found.name,
                    ignore=shutil.ignore_patterns(".*"),
                    dirs_exist_ok=True,
                )
            else:
                shutil.copy2(found, left / found.name)
