"""Compile the sequential kernels once, so that no run has to wait for it.

python -m kinacc.workflow.warm_up
"""

from __future__ import annotations


def main() -> None:
    """Run what uses compiled kernels on a tiny problem."""
    import numpy as np

    from kinacc.config.schema import defaults
    from kinacc.kinematics import dh, inverse, robot
    from kinacc.workflow.stages import histories, study_chunk

    settings = defaults()
    settings["study"] |= {"repetitions": 1, "measurements": 20, "noise_mm": [0.1]}
    settings["histories"]["simulations_searched"] = 1
    error_mm = np.linspace(0.1, 0.9, 30).reshape(10, 3)
    points = {
        "point": np.arange(10),
        **{f"e{axis}_mm": error_mm[:, i] for i, axis in enumerate("xyz")},
        "true_error_mm": np.linalg.norm(error_mm, axis=1),
    }
    study_chunk.run({"assessment_points": points}, settings)
    histories.run({"assessment_points": points}, settings)
    many = np.zeros((dh.WORTH_NUMBA // 6 + 1, 6))  # fewer would be left to the plain code
    arm = robot.load("mh180")
    dh.forward(arm.dh, many)
    dh.pose_and_joint_jacobian(arm.dh, many[:1])
    dh.pose_and_parameter_jacobian(arm.dh, many[:1])
    inverse.solve(arm, arm.dh, dh.forward(arm.dh, many[:1]))
    arm = robot.load("iiwa14")  # no closed form: its inverse searches
    inverse.solve(arm, arm.dh, dh.forward(arm.dh, np.full((1, 7), 0.5)))


if __name__ == "__main__":
    main()
