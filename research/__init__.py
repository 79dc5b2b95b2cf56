"""Research with kinacc, beside the package: research/README.md. Nothing of kinacc imports it."""
