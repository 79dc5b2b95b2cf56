"""Bad input and failing stages: a reason a person can act on, and nothing half done."""

CSV = "own data/poses.csv"
TABLE = "results/own/measurements.parquet"


def test_a_stage_that_fails(project):
    before = project.digests()
    project.configure("histories: {noise_mm: 0.2}")
    project.append(
        "src/kinacc/study/histories.py",
        "def run(inputs, settings):\n    raise ArithmeticError('the world ended')",
    )
    text = project.snakemake("results/mh180/histories.parquet", code=1)
    log = (project.folder / "results/mh180/logs/histories.log").read_text()
    for place in (text, log):
        assert "ArithmeticError: the world ended" in place
    after = project.digests()
    assert "mh180/histories.parquet" not in after
    assert {name: before[name] for name in after} == after
    assert not [*(project.folder / "results").rglob("*.partial")]


def test_a_row_that_cannot_be_right(project):
    before = project.digests()
    path = project.folder / CSV
    good = path.read_text()
    lines = good.splitlines()
    fields = lines[3].split(",")
    fields[6] = "123o.4"
    lines[3] = ",".join(fields)
    path.write_text("\n".join(lines) + "\n")
    for _ in range(2):  # the second run must not take the earlier table for this file's
        text = project.snakemake(TABLE, code=1)
        assert "x_mm" in text
        assert "poses.csv" in text
        assert "Traceback" not in text
        after = project.digests()
        assert {name: before[name] for name in after} == after
    path.write_text(good)
    project.snakemake(TABLE)
    assert project.digests() == before
