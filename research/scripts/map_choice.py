"""Which reading of Fig. 3 is the default: chosen by a rule, before the shipped arm's maps."""

import pandas as pd

from research.map_readings import choice

table = pd.concat(map(pd.read_parquet, snakemake.input), ignore_index=True)
choice(table).to_csv(snakemake.output[0], index=False, float_format="%.4f")
