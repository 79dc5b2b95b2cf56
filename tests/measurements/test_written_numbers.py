"""Numbers written into one word of a command."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.measurements.table import numbers_of


@pytest.mark.parametrize("text", ["1,2.5,-3e-1", "1 2.5 -3e-1", " 1, 2.5 , -3e-1 "])
def test_commas_and_blanks_part_numbers(text):
    np.testing.assert_array_equal(numbers_of(text), [1.0, 2.5, -0.3])


@pytest.mark.parametrize("text", ["", ",", "1,two", "1,nan", "inf", "1;2"])
def test_what_is_no_finite_number_makes_none(text):
    assert numbers_of(text).shape == (0,)
