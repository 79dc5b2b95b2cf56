"""Readings that could be lost, taken away or never taken: cuts, deletions, clocks, odd names."""

from __future__ import annotations

import hashlib
import re

from campaign_on_disk import SIGMA_MM, Arm, recorded
from command_line import call


def test_a_report_kept_elsewhere_tells_that_its_last_readings_were_taken_away(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    recorded(folder, arm := Arm(folder), 5)
    earlier = {each.name: each.read_bytes() for each in folder.iterdir() if each.is_file()}
    recorded(folder, arm, 2)
    call("campaign", "report", folder)
    text = (folder / "report" / "report.md").read_text()
    told = re.search(r"7 readings; SHA-256 of readings.jsonl (\w{64})", text)[1]
    assert told == hashlib.sha256((folder / "readings.jsonl").read_bytes()).hexdigest()
    known = ("verify", folder, "--sha256", told, "--readings", 7)
    assert call("campaign", *known).output.startswith("PASS")
    recorded(folder, arm, 1)
    call("campaign", *known, code=0)
    for name, content in earlier.items():  # the folder as it was before the two readings
        (folder / name).write_bytes(content)
    call("campaign", "verify", folder, code=0)
    call("campaign", *known, code=1)
    recorded(folder, Arm(folder, 1.1 * SIGMA_MM), 2)  # others in their place
    call("campaign", "verify", folder, "--readings", 7, code=0)
    call("campaign", *known, code=1)
