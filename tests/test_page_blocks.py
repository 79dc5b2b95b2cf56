"""What the tests of pages take from a page, and what they take for printed."""

from __future__ import annotations

import pytest
from page_blocks import blocks, exchanges, not_printed

PAGE = """\
Type this:

<!-- exit code 1: it has suspicions -->
<!-- in a clone: the data stand there -->
```sh
kinacc check-data x.yaml
```

```console
$ kinacc plan --a \\
      --b
12 poses
$ kinacc next
```
"""


def test_notes_above_a_block_are_read_with_their_reasons(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    first, second = blocks(page)
    assert (first.language, first.text, first.exit_code) == ("sh", "kinacc check-data x.yaml\n", 1)
    assert first.notes["in a clone"] == "the data stand there"
    assert first.place == "page.md:5"
    assert (second.notes, second.exit_code) == ({}, 0)
    typed = list(exchanges(second))
    assert typed == [("kinacc plan --a \\\n      --b", "12 poses"), ("kinacc next", "")]


PRINTED = "progress\nDH    0.370   1.008\nline 534 repeats 533\nend"


@pytest.mark.parametrize(
    ("expected", "missing"),
    [
        ("DH 0.370 1.008\n..\nend", []),
        ("DH 0.371 1.008", []),  # another processor
        ("DH 0.470 1.008", ["DH 0.470 1.008"]),
        ("VEC 0.370 1.008", ["VEC 0.370 1.008"]),
        ("line 544 repeats 533", ["line 544 repeats 533"]),
        ("end\nDH 0.370 1.008", ["DH 0.370 1.008"]),  # in another order
    ],
)
def test_a_line_that_was_not_printed_is_named(expected, missing):
    assert not_printed(expected, PRINTED) == missing
