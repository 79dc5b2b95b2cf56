"""Campaigns beside results: how their files are called, and whose calibration they are about.

Each start of the workflow reads this: it does without what computes.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from kinacc.config import json_files
from kinacc.errors import InputError

PLAN, JOURNAL = "campaign.json", "readings.jsonl"


def of_results(results: Path) -> list[Path]:
    """Folders of campaigns on the calibration in a results folder, by the name they have of it.

    They are searched beside it, beside all results, and in the working folder; each is named as a
    person there would.
    """
    name, campaigns = results.resolve().name, []
    places = (results.parent, results.parent / "..", Path())
    for place in {place.resolve(): place for place in places}.values():
        for path in sorted(place.glob(f"*/{PLAN}")):
            # What cannot be read is no campaign, or one that cannot state whose it is.
            with suppress(InputError, OSError, ValueError, LookupError, TypeError, RecursionError):
                content = json_files.values_of(json_files.bytes_of(path), str(path))
                if content["about"]["calibration"] == name:
                    campaigns.append(path.parent)
    return campaigns
