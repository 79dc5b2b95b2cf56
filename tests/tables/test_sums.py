"""Digests of stages: what was edited, what is missing, what was made from older files."""

import hashlib
import subprocess

import pytest

from kinacc.errors import InputError
from kinacc.tables import sums


@pytest.fixture
def folder(tmp_path):
    """A data set: ``fit`` was made from ``poses``, which was made from a file beside it."""
    (tmp_path / "poses.csv").write_bytes(b"1,2,3\n")
    own = tmp_path / "results" / "arm"
    (own / "sums").mkdir(parents=True)
    outside = {"../../poses.csv": hashlib.sha256(b"1,2,3\n").hexdigest()}
    leave(own, "measurements", {"poses.parquet": b"poses"}, outside)
    read = {"poses.parquet": hashlib.sha256(b"poses").hexdigest()}
    leave(own, "fit", {"fit.parquet": b"fit", "more.parquet": b"more"}, read)
    return own


def leave(folder, stage, written, read):
    for name, content in written.items():
        (folder / name).write_bytes(content)
    (folder / "sums" / f"{stage}.sha256").write_bytes(sums.text_of(written, read))


def test_digests_are_those_of_sha256sum(folder):
    lists = sorted(str(path.relative_to(folder)) for path in folder.glob("sums/*"))
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "--quiet", *lists],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "")
    assert sums.stated(folder) == {
        "poses.parquet": hashlib.sha256(b"poses").hexdigest(),
        "fit.parquet": hashlib.sha256(b"fit").hexdigest(),
        "more.parquet": hashlib.sha256(b"more").hexdigest(),
    }


def test_an_edited_file_is_refused_by_its_name_with_what_to_do(folder):
    path = folder / "poses.parquet"
    sums.hold(path, path.read_bytes())
    with pytest.raises(InputError) as caught:
        sums.hold(path, b"poses, edited")
    assert caught.value.problems[0].where == str(path)
    assert f"rm {path}" in caught.value.problems[0].fix
    path.write_bytes(b"poses, edited")
    assert [problem.where for problem in sums.changed(folder)] == [str(path)]


def test_a_stage_that_ran_again_makes_what_was_made_from_its_table_outdated(folder):
    leave(folder, "measurements", {"poses.parquet": b"new poses"}, {})
    assert sums.outdated(folder) == ["fit.parquet", "more.parquet"]
    assert [name.rpartition("/")[2] for name in sums.changed_since(folder)] == ["poses.parquet"]
    assert list(sums.changed(folder)) == []
