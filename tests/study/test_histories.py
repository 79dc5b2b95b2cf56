"""Histories: each example obeys its rule, is the first to do so, and says when none does."""

from __future__ import annotations

import numpy as np
import pandas as pd
import paper_settings as paper

from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.config.records import of_section
from kinacc.study.histories import (
    FALLBACK,
    KEPT,
    REJECTED,
    examples,
    histories,
)
from kinacc.study.monte_carlo import Visits

SEED = 3
STUDY = of_section(Visits, paper.study())
ASSESSOR = of_section(ModelInvalidation, paper.study())


ERROR = np.random.default_rng(0).normal(size=(200, 3)) * 0.2


def test_where_no_simulation_obeys_the_rule_the_nearest_is_shown_and_says_so():
    far = paper.histories(eta_ratio_rejected=3.0, eta_ratio_kept=0.05, simulations_searched=4)
    table = histories(ERROR, far, STUDY, ASSESSOR, SEED)
    for example in (REJECTED, KEPT):
        rows = pd.DataFrame(table).query(f"example == '{example}'")
        assert not rows["rule_met"].any()
        assert {*rows["rule"]} == {FALLBACK}
        assert {*rows["simulation"]} == {0}
    # Rejected at eta, but at the larger bound too.
    near = paper.histories(eta_ratio_rejected=0.05, eta_ratio_larger=0.06, simulations_searched=4)
    found = examples(ERROR, near, STUDY, ASSESSOR, SEED)[0]
    assert (found.simulation, found.rule, found.rule_met) == (0, FALLBACK, False)
