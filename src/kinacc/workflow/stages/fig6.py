"""Draw Fig. 6, the history of a simulation that could not invalidate the model."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from kinacc.figures import fig6, truth

EXAMPLE = "not_rejected"


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the example ``not_rejected`` of the ``histories``."""
    return fig6.draw(
        inputs["histories"],
        example=EXAMPLE,
        true_accuracy_mm=truth.accuracy_mm(inputs.get("assessment_points")),
        noisy_truth=truth.is_noisy(settings),
        dataset=settings.get("dataset"),
    )
