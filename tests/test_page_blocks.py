"""What the tests of pages take from a page."""

from __future__ import annotations

from page_blocks import blocks, typed

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
    assert typed(second) == "kinacc plan --a \\\n      --b\nkinacc next"
