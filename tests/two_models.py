"""A VEC model as the true arm and a DH model under assessment, as maps and points take them."""

from __future__ import annotations

from kinacc.geometry import IDENTITY
from kinacc.study.accuracy_map import Equipped, Models


def two_models(vec, dh, vec_tool=IDENTITY, dh_tool=IDENTITY, travel=None) -> Models:
    by_name = {
        "vec": Equipped(vec, vec_tool),
        "dh": Equipped(dh, dh_tool),
        "nominal": Equipped(None, dh_tool),
    }
    return Models(by_name, travel)
