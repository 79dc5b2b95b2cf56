"""Which campaign of a calibration counts, and what is said of the others."""

from __future__ import annotations

import json
import math
import os
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

from campaign_on_disk import SIGMA_MM, Arm, recorded, refused, standing

from kinacc.campaign.campaign import Campaign
from kinacc.campaign.of_calibration import finished, newest
from kinacc.deployment.folder import read_tables


def test_the_newest_campaign_counts_and_the_others_are_named(begun, study):
    other, spoilt, newer, older = (begun("--noise-mm", SIGMA_MM) for _ in range(4))
    plan = json.loads((other / "campaign.json").read_text())
    plan["points"][0]["modelled_mm"][0] += 0.01
    (other / "campaign.json").write_text(json.dumps(plan))
    (spoilt / "campaign.json").write_text("{}")
    for age, folder in enumerate((other, spoilt, newer, older)):
        os.utime(folder / "campaign.json", (1e9 - age, 1e9 - age))
    tables = read_tables(study, "robot")
    of_vec = begun("--noise-mm", SIGMA_MM, "--model", "vec")  # the newest of all
    found, remarks = newest("arm", "dh", tables, [of_vec, older, newer, spoilt, other])
    assert found.folder == str(newer)
    assert newest("arm", "vec", tables, [older, newer])[0].folder == str(newer)
    assert remarks == (
        f"campaign {other} was begun with another calibration of arm",
        f"campaign {spoilt} cannot be read: kinacc campaign status '{spoilt}'",
    )


def test_the_bound_of_a_finished_campaign_on_the_model_is_taken(begun, study, monkeypatch):
    tables = read_tables(study, "robot")

    def taken(readings=20, sigma_mm=SIGMA_MM, **plan):
        folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", **plan)
        recorded(folder, Arm(folder, sigma_mm), readings)
        return folder

    assert math.isnan(finished(tables, "dh", [taken(19)]))
    folder = taken()
    assert Campaign(folder).next_pose() is None
    assert "no further reading is needed" in refused(
        folder, "record", folder, "--position-mm", "1,2,3"
    )
    bound_mm = finished(tables, "dh", [folder])
    assert bound_mm == standing(folder)["bounds"][0]["upper_mm"]
    tomorrow = datetime.now(UTC) + timedelta(days=1)
    monkeypatch.setattr("kinacc.campaign.folder.datetime", SimpleNamespace(now=lambda _: tomorrow))
    later = taken(sigma_mm=0.5 * SIGMA_MM)
    last_mm = finished(tables, "dh", [later])
    assert finished(tables, "dh", [later, folder]) == last_mm != bound_mm
    assert math.isnan(finished(tables, "vec", [folder]))
    assert math.isnan(finished(tables, "dh", [taken(points=40)]))  # bounds all but a few
    (folder / "readings.jsonl").write_text("no journal")
    assert math.isnan(finished(tables, "dh", [folder]))
