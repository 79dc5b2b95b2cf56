"""The contract is whole, and agrees with the stages."""

from __future__ import annotations

import pytest

from kinacc.tables.contract import ARTEFACTS


@pytest.mark.parametrize("name", ARTEFACTS)
@pytest.mark.parametrize("joints", [4, 6, 7])
def test_tables_are_well_formed(name, joints):
    artefact = ARTEFACTS[name]
    names = [column.name for column in artefact.for_joints(joints)]
    assert len(names) == len(set(names))
    assert set(artefact.key) <= set(names)
    assert [column.name for column in artefact.in_file(names)] == names


@pytest.mark.parametrize("name", ARTEFACTS)
def test_units_are_those_the_names_carry(name):
    endings = ("mm", "mrad", "rad", "deg")
    for column in ARTEFACTS[name].columns:
        assert column.meaning
        assert (column.unit == "") == (column.kind == "text")
        ending = column.name.rpartition("_")[2]
        if ending in endings and "_per_" not in column.name:
            assert column.unit == ending
