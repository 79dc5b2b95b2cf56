"""The page on what the paper's statements hang on, and its picture."""

from pathlib import Path

import pandas as pd

from research import claims_over_choices, reasons
from research.claims_page import claims_page

choices, factors = map(pd.read_parquet, snakemake.input)
Path(snakemake.output.page).write_text(claims_page(choices, factors), encoding="utf-8")
figure = claims_over_choices.draw(reasons.shares(choices), reasons.reasons(choices, factors))
figure.savefig(snakemake.output.picture, dpi=150)
