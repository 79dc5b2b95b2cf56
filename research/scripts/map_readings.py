"""All readings of Fig. 3, and what share of the arms each sentence holds on."""

import pandas as pd

from research.fig3_readings import draw

table = pd.concat(map(pd.read_parquet, snakemake.input), ignore_index=True)
table.to_parquet(snakemake.output.table)
draw(table, dataset="mh180").savefig(snakemake.output.figure)
