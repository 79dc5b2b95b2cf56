"""Every sentence on Fig. 3 on every arm found under one reading."""

import pandas as pd

from kinacc.config.schema import defaults
from research.map_readings import READINGS, judged_arms

reading, given = READINGS[int(snakemake.wildcards.number)], snakemake.params
config = {"robot": "mh180", **defaults()}
pd.DataFrame(judged_arms(reading, config, given.arms, given.seeds)).to_parquet(snakemake.output[0])
