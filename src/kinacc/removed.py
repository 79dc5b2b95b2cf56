"""Commands, options and keys that are gone or renamed: one line each, for one release."""

from __future__ import annotations

_RESEARCH = "now in research/ of the repository: snakemake -c2 -s research/Snakefile"
COMMANDS = {
    "tournament": f"{_RESEARCH} tournament",
    "draw-robots": f"{_RESEARCH} arms",
    "run": "now Snakemake's own: snakemake -c1 --until fit_dh, or -R fit_dh for a stage anew",
    "fitted": "now kinacc summary RESULTS (--verbose in place of --all)",
    "gate": "now kinacc check-results RESULTS --config FILE --against FOLDER",
    "plan-campaign": "now kinacc campaign plan (--candidates in place of --poses)",
    "accept": 'now kinacc check-results RESULTS --accept FOLDER --reason ".."',
}
_CAMPAIGN = {
    "--correct-drift": "a drift that --references find withholds the bound; begin anew then",
    "--assume": "with fewer readings than candidates the bound is on all but so many",
}
# Options by command, or by the group that the command is in.
OPTIONS = {
    "check-results": {
        "--all": "numbers are not computed again; --against FOLDER compares with an accepted run",
        "--expect": "keep results/SHA256SUMS elsewhere and run sha256sum -c on it",
    },
    "show": {"--plot": "pictures are in the folder figures and on the page: kinacc report RESULTS"},
    "plan-poses": {
        "--index": "poses are D-optimal (O1)",
        "--metric": "travel is that of the joint that moves most",
    },
    "campaign": _CAMPAIGN
    | {
        "--simulations": "kinacc campaign plan simulates budgets before a campaign begins",
        "--head": "now --sha256 with --readings, as a report gives them",
    },
}
# Options that are taken under their former names too.
RENAMED = {
    "check-data": {"--figure": "--picture"},
    "export": {"--to": "--out"},
    "campaign": {"--to": "--out", "--output": "--out"},
    "predict": {"--output": "--out"},
    "compensate": {"--output": "--out"},
    "compare": {"--output": "--out"},
    "plan-poses": {"--output": "--out"},
}
# Sections and keys of the configuration.
KEYS = {
    "choices": "the claims over open choices are in research/ (research/config.yaml)",
    "map_readings": "the readings of Fig. 3 are in research/ (research/config.yaml)",
    "tournament": "the tournament is in research/ (research/config.yaml)",
}
# Settings of assessors (study, --set), with the defaults that earlier plans state.
SETTINGS = {"correct_drift": False, "assume": "nothing", "isolation": 1.25, "crowd": 0.05}
