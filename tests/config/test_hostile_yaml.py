"""Any text given as a configuration is read or refused: no traceback, soon and in little memory."""

import resource
import tempfile
from contextlib import suppress
from pathlib import Path

import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.checks.contradictions import load
from kinacc.config.schema import defaults
from kinacc.errors import InputError

WORDS = ["datasets", "robot", "mh180", "series", "path", "date", "gates", "value", "kind", "file"]
NAMES = st.sampled_from([*WORDS, *defaults(), *defaults()["measurements"]["file"]]) | st.text()
SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.dates() | st.binary() | NAMES
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(NAMES, inner, max_size=4),
    max_leaves=12,
)


def read_or_refused(text: str) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "own.yaml"
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
        with suppress(InputError):
            load([path])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000


@settings(max_examples=80, deadline=5000)
@given(VALUES, st.sampled_from(sorted(defaults())), st.data())
def test_any_values_in_any_section(value, section, data):
    own = {"robot": "mh180", section: value}
    if isinstance(default := defaults()[section], dict):
        own[section] = {data.draw(st.sampled_from(sorted(default))): value}
    read_or_refused(yaml.dump({"datasets": {"a": own}, section: value}))


@settings(max_examples=80, deadline=5000)
@given(VALUES | st.text(alphabet="ab:-{}[],&*!|>'\"# \n\t1"))
def test_any_text(value):
    read_or_refused(value if isinstance(value, str) else yaml.dump(value))
    read_or_refused(f"datasets: {value if isinstance(value, str) else yaml.dump(value)}")
