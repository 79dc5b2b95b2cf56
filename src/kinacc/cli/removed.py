"""Commands that are gone, and where to find what they did: one line each, for one release."""

from __future__ import annotations

_RESEARCH = "now in research/ of the repository: snakemake -c2 -s research/Snakefile"
REMOVED_COMMANDS = {
    "tournament": f"{_RESEARCH} tournament",
    "draw-robots": f"{_RESEARCH} arms",
    "run": "now Snakemake's own: snakemake -c1 --until fit_dh, or -R fit_dh for a stage anew",
    "gate": "now kinacc check-results RESULTS --config FILE --against FOLDER",
    "accept": 'now kinacc check-results RESULTS --accept FOLDER --reason ".."',
}
