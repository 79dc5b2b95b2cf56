"""Where pinocchio puts a link of a URDF."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from pose_checks import of_matrices


def seen_by_pinocchio(model, tip, q_rad, slides, names, base="base_link"):
    """Tip frames (n, ...) in mm at joints (n, k), rad and mm."""
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in names]
    ends = []
    for row in q_rad * np.where(slides, 1e-3, 1.0):
        step = np.zeros(model.nv)
        step[order] = row
        pin.framesForwardKinematics(model, data, pin.integrate(model, pin.neutral(model), step))
        first, last = (data.oMf[model.getFrameId(link, pin.FrameType.BODY)] for link in (base, tip))
        ends.append(first.inverse() * last)
    found = of_matrices([end.homogeneous for end in ends])
    return found._replace(position_mm=1e3 * found.position_mm)
