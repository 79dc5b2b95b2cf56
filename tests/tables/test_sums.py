"""Digests of stages, as ``sha256sum`` checks them."""

import hashlib
import subprocess

from kinacc.tables import sums


def test_digests_are_those_of_sha256sum(tmp_path):
    own = tmp_path / "results" / "arm"
    own.mkdir(parents=True)
    contents = {"fit.parquet": b"fit", "more.parquet": b"more"}
    for name, content in contents.items():
        (own / name).write_bytes(content)
    (tmp_path / "poses.csv").write_bytes(b"1,2,3\n")
    read = {"../../poses.csv": hashlib.sha256(b"1,2,3\n").hexdigest()}
    (own / "fit.sha256").write_bytes(sums.text_of(contents, read))
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "--quiet", "fit.sha256"],
        cwd=own, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "")
