"""The paper's numbers and sentences as computed checks: agrees, differs or not comparable."""

from kinacc.study.claims.evaluate import all_claims, evaluate

__all__ = ["all_claims", "evaluate"]
