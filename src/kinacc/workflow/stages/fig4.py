"""Draw Fig. 4, assessed accuracy against noise."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from kinacc.figures import fig4, truth


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``study_summary``, with the truth of ``assessment_points``."""
    return fig4.draw(
        inputs["study_summary"],
        true_mm=truth.accuracy_mm(inputs.get("assessment_points")),
        noisy_truth=truth.is_noisy(settings),
        dataset=settings.get("dataset"),
    )
