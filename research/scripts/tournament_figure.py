"""One quantity of the tournament with 200 readings."""

import pandas as pd

from research.tournament_figures import draw

cells = pd.read_parquet(snakemake.input[0])
draw(cells, snakemake.wildcards.quantity, 200).savefig(snakemake.output[0], dpi=150)
