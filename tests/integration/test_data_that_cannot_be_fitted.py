"""Measured data whose fit would be wrong: stopped before it, and what a person can do then."""

import json

import numpy as np
import pytest

CSV = "own data/poses.csv"
MODEL = "results/own/vec_model.parquet"
FITS = ("vec_model", "vec_frames", "dh_model", "frames", "residuals")


def change(project, row, column, by):
    """Add to a number of the measured file; ``row`` counts from 0 under the names."""
    path = project.folder / CSV
    lines = path.read_text().splitlines()
    cells = lines[row + 1].split(",")
    cells[column] = f"{float(cells[column]) + by:.9f}"
    lines[row + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")


def test_a_slip_of_80_mm_in_one_row(project):
    before = project.digests()
    change(project, 20, 7, 80.0)
    text = project.snakemake(ok=False)
    assert "outliers" in text
    assert "line 22" in text
    assert "80" in text
    assert "exclude" in text
    assert "--accept" in text
    assert "Traceback" not in text
    after = project.digests()
    assert all(after[f"own/{name}.parquet"] == before[f"own/{name}.parquet"] for name in FITS)
    assert "own/data_check.parquet" not in after

    # The reason to go on is given: it runs, and says so at its end and in `kinacc summary`.
    small = project.folder / "small.yaml"
    good = small.read_text()
    project.configure("datasets: {own: {data_check: {accept: {outliers: tried on purpose}}}}")
    project.snakemake(MODEL)
    slipped = project.digests()["own/vec_model.parquet"]

    # The row is excluded: no fit sees it, and figures stand with and without it.
    small.write_text(good)
    reason = "the reflector slipped"
    row = f"{{lines: [22], reason: {reason}}}"
    project.configure(f"datasets: {{own: {{measurements: {{file: {{exclude: [{row}]}}}}}}}}")
    project.snakemake()
    assert project.digests()["own/vec_model.parquet"] != slipped
    text = project.kinacc("summary", "results/own", "--json", configs=())
    answer = json.JSONDecoder().raw_decode(text)[0]["own"]  # warnings may follow
    (excluded,) = answer["excluded"]
    assert (excluded["line"], excluded["reason"]) == (22, reason)
    assert excluded["error_mm"] == pytest.approx(80.0, abs=3.0)
    assert max(each["largest"] for each in answer["errors"] if each["unit"] == "mm") < 5.0
    assert "PASS" in project.kinacc("check-results", "results/own")


def test_the_wrong_robot(project):
    project.configure("datasets: {own: {robot: fanuc_r2000ic_165f}}")
    text = project.snakemake(MODEL, ok=False)
    assert "does_not_fit" in text or "outside the joint limits" in text
    assert "Traceback" not in text


def test_a_base_that_moved_half_way(project):
    path = project.folder / CSV
    lines = path.read_text().splitlines()
    head, rows = lines[0], [line.split(",") for line in lines[1:]]
    for cells in rows[35:]:
        for axis, by in ((6, 9.0), (7, -6.0), (8, 4.0)):
            cells[axis] = f"{float(cells[axis]) + by:.9f}"
    path.write_text("\n".join([head, *(",".join(cells) for cells in rows)]) + "\n")
    text = project.snakemake(MODEL, ok=False)
    assert "base_jump" in text
    assert "line 37" in text
    assert "session" in text


def test_eight_poses_read_thirty_times_for_216_coefficients(project):
    path = project.folder / CSV
    lines = path.read_text().splitlines()
    rng, rows = np.random.default_rng(0), []
    for line in lines[1:9]:
        cells = line.split(",")
        for _ in range(30):
            read = [f"{float(cells[i]) + rng.normal(0, 0.02):.6f}" for i in (6, 7, 8)]
            rows.append(",".join([*cells[:6], *read, *cells[9:]]))
    path.write_text("\n".join([lines[0], *rows]) + "\n")
    project.configure("calibration: {vec: {order: 5}}")
    text = project.snakemake(MODEL, ok=False)
    assert "few_poses" in text, text
    assert "8 different poses" in text
    assert "216 coefficients" in text
    assert "calibration.vec.order" in text
