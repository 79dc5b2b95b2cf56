"""Results are those of the golden files, stage by stage: each on its own golden inputs."""

import json

import cases
import pandas as pd
import pytest

from kinacc.deployment.export.files import contents
from kinacc.deployment.export.source import read_source
from kinacc.tables.comparison import compare_folders

# Other settings, by which a stage makes some rows of its golden table, and which these are.
SAMPLES = {
    "accuracy_map": (
        {"map": {"slices_deg": [0.0, 15.0, 30.0, 45.0, 60.0], "grid_mm": 50.0}},
        "radius_mm % 50 == 0 and height_mm % 50 == 0",
    ),
    "study_chunk": ({"part": {"number": 4, "of": 4}}, "repetition % 4 == 3"),
}
STAGES = [
    (name, stage, "sample" if stage in SAMPLES else "whole")
    for name, stages in cases.DATA_SETS.items()
    for stage in stages
]
STAGES += [pytest.param("mh180", stage, "whole", marks=pytest.mark.night) for stage in SAMPLES]


@pytest.fixture(scope="module")
def data():
    return cases.data_sets()


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(("name", "stage", "part"), STAGES)
def test_a_stage_makes_its_golden_tables(name, stage, part, data, tmp_path):
    other, rows = SAMPLES[stage] if part == "sample" else ({}, "index >= 0")
    made = cases.run_stage(data, name, stage, cases.RESULTS / name, **other)
    cases.write_tables(made, tmp_path / "made")
    tables = cases.tables_in(cases.RESULTS / name)
    golden = {table: pd.DataFrame(dict(tables[table])).query(rows) for table in made}
    cases.write_tables(golden, tmp_path / "golden")
    differences = list(compare_folders(tmp_path / "golden", tmp_path / "made"))
    assert not differences, "\n".join(differences)


def close(number):
    """What equals a number to 1e-6."""
    return pytest.approx(float(number), rel=1e-6, abs=1e-6, nan_ok=True)


def golden(path):
    """The content of a golden file, to whose numbers others are equal where they are close."""
    return json.loads(path.read_text(), parse_float=close, parse_constant=close)


FINDINGS = golden(cases.GOLDEN / "faults" / "findings.json")


@pytest.mark.parametrize("name", FINDINGS)
def test_a_planted_fault_is_found_with_its_rows_and_size(name):
    assert json.loads(json.dumps(cases.findings(cases.GOLDEN / "faults", name))) == FINDINGS[name]


def test_every_planted_fault_but_none_has_a_finding():
    assert [name for name, found in FINDINGS.items() if not found] == ["none"]


@pytest.mark.parametrize(("model", "formats"), [("dh", ("json", "yaml", "csv", "urdf")),
                                                ("vec", ("json",))])  # fmt: skip
def test_exports_are_as_before(model, formats):
    folder = cases.RESULTS / "ur10_d"
    made = contents(read_source(folder, model), formats)
    for name, text in made.items():
        path = cases.GOLDEN / "exports" / name
        if name.endswith(".json"):
            assert json.loads(text) == golden(path)
        else:
            assert text == path.read_text()


def test_a_campaign_makes_its_golden_statements():
    course = json.loads(json.dumps(cases.campaign_course()))
    assert course == golden(cases.GOLDEN / "campaign" / "course.json")


def test_golden_files_are_small():
    sizes = {path: path.stat().st_size for path in cases.GOLDEN.rglob("*") if path.is_file()}
    assert max(sizes.values()) < 2**20
    assert sum(size for path, size in sizes.items() if "__pycache__" not in path.parts) < 8 * 2**20
