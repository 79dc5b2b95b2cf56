"""The Parquet artefacts: their contract as data, reading and atomic writing, and the check."""
