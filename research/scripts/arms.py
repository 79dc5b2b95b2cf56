"""The first accepted draws of the synthetic arm, as a table to ship."""

from pathlib import Path

from kinacc.config.schema import defaults
from research.arm_search import as_csv, bench_of, search

found = search(bench_of({"robot": "mh180", **defaults()}), snakemake.params.arms)
Path(snakemake.output[0]).write_text(as_csv(found), encoding="utf-8")
