"""All cells in the order of their keys, and the verdicts on every assessor."""

import pandas as pd

from research.verdicts import CELL, judged

cells = pd.concat(map(pd.read_parquet, snakemake.input)).sort_values(CELL, ignore_index=True)
cells.to_parquet(snakemake.output.cells)
judged(cells).to_parquet(snakemake.output.verdicts)
