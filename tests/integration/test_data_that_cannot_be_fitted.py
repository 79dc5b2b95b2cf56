"""Measured data whose fit would be wrong: stopped before it, and what a person can do then."""

import json

import pytest

CSV = "own data/poses.csv"
MODEL, SUMMARY = "results/own/vec_model.parquet", "results/own/summary.parquet"
FITS = ("vec_model", "vec_frames", "dh_model", "frames", "residuals")


def test_a_slip_of_80_mm_in_one_row(project):
    before, path = project.digests(), project.folder / CSV
    lines = path.read_text().splitlines()
    cells = lines[21].split(",")
    lines[21] = ",".join([*cells[:7], f"{float(cells[7]) + 80.0:.9f}", *cells[8:]])
    path.write_text("\n".join(lines) + "\n")
    text = project.snakemake(SUMMARY, code=1)
    for word in ("outliers", "line 22", "exclude", "--accept"):
        assert word in text
    assert "Traceback" not in text
    after = project.digests()
    assert all(after[f"own/{name}.parquet"] == before[f"own/{name}.parquet"] for name in FITS)
    assert "own/data_check.parquet" not in after

    # The reason to go on is given: it runs, and says so at its end and in `kinacc summary`.
    small = project.folder / "small.yaml"
    good = small.read_text()
    project.configure("datasets: {own: {data_check: {accept: {outliers: tried on purpose}}}}")
    assert "Mean position error" not in project.snakemake(MODEL)  # nobody asked for a summary
    slipped = project.digests()["own/vec_model.parquet"]

    # The row is excluded: no fit sees it, and figures stand with and without it.
    small.write_text(good)
    reason = "the reflector slipped"
    row = f"{{lines: [22], reason: {reason}}}"
    project.configure(f"datasets: {{own: {{measurements: {{file: {{exclude: [{row}]}}}}}}}}")
    (project.folder / "results/own/SHA256SUMS").unlink()  # of the study, which stays as it was
    project.snakemake(SUMMARY, "results/own/excluded_rows.parquet")
    assert project.digests()["own/vec_model.parquet"] != slipped
    text = project.kinacc("summary", "results/own", "--json")
    answer = json.JSONDecoder().raw_decode(text)[0]["own"]  # warnings may follow
    (excluded,) = answer["excluded"]
    assert (excluded["line"], excluded["reason"]) == (22, reason)
    assert excluded["error_mm"] == pytest.approx(80.0, abs=3.0)
    assert max(each["largest"] for each in answer["errors"] if each["unit"] == "mm") < 5.0
    assert "PASS" in project.kinacc("check-results", "results/own")
