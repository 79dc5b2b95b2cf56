"""The parts of both tables in the order of the runs."""

import pandas as pd

for name, paths in snakemake.input.items():
    table = pd.concat(map(pd.read_parquet, paths))
    table.sort_values("run", kind="stable", ignore_index=True).to_parquet(snakemake.output[name])
