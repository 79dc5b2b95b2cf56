"""Fit robotkinecal to folds, in its environment: python robotkinecal_folds.py GIVEN.npz FOUND.npz

Given: DH joints ``q_rad`` (n, k), ``position_mm`` (n, 3), ``fold`` (n,) and ``dh`` (k, 4): theta
rad, d mm, a mm, alpha rad. Found: ``predicted_mm`` (n, 3), each by the fit without its fold, and
``seconds`` of CPU time of all fits.
"""

import sys
import time

import numpy as np
from roboticstoolbox import ET, ETS, ERobot, Link
from robotkinecal import SerialRobotKineCal


def arm(rows):
    """The nominal arm in metres: each link has the fixed rest of the row before, and its joint."""
    links, rest = [], []
    for theta, d_mm, a_mm, alpha in rows:
        link = ETS([*rest, ET.Rz(theta), ET.Rz()])
        links.append(Link(link, name=f"link{len(links)}", parent=links[-1] if links else None))
        rest = [ET.tz(d_mm / 1e3), ET.tx(a_mm / 1e3), ET.Rx(alpha)]
    return ERobot([*links, Link(ETS(rest), name="flange", parent=links[-1])])


def main(given_path, found_path):
    given = np.load(given_path)
    q_rad, position_mm, fold = given["q_rad"], given["position_mm"], given["fold"]
    predicted_mm, seconds = np.empty_like(position_mm), 0.0
    np.random.seed(0)  # noqa: NPY002  it draws its bases of twists from this
    for number in np.unique(fold):
        out = fold == number
        begin = time.process_time()
        fit = SerialRobotKineCal(arm(given["dh"]), ee_name="flange")
        fit.set_observations(list(q_rad[~out]), list(position_mm[~out] / 1e3))
        fit.solve()
        seconds += time.process_time() - begin
        poses = [fit.forward_kinematics(fit.N_JOINTS + 1, q) for q in q_rad[out]]
        predicted_mm[out] = [1e3 * pose.t for pose in poses]
    np.savez(found_path, predicted_mm=predicted_mm, seconds=seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
