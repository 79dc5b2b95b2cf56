"""A laser tracker's noise, by range and angles, at each candidate's distance from its head."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.differentiate import jacobian
from scipy.spatial.transform import Rotation

from kinacc.campaign import folder as campaigns
from kinacc.campaign.instrument import instruments
from kinacc.errors import InputError
from kinacc.geometry import Pose

LASER = "laser:range_mm=0.01,range_um_per_m=5,angle_mm=0.02,angle_um_per_m=15,repeat_mm=0.03"


def of_spherical_readings(seen_mm):
    """Covariance of x, y, z of a reading of range, azimuth and elevation, by their differences."""

    def cartesian(at):
        distance, azimuth, elevation = at
        flat = distance * np.cos(elevation)
        return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth),
                         distance * np.sin(elevation)])  # fmt: skip

    x, y, z = seen_mm
    distance = np.sqrt(x * x + y * y + z * z)
    at = np.array([distance, np.arctan2(y, x), np.arcsin(z / distance)])
    across = 0.02 + 15e-6 * distance
    std = np.array([0.01 + 5e-6 * distance, across / np.hypot(x, y), across / distance])
    slope = jacobian(cartesian, at).df
    return slope @ np.diag(std**2) @ slope.T + 0.03**2 * np.eye(3)


def test_a_laser_tracker_is_as_sure_of_each_candidate_as_its_range_and_angles_there(begun):
    folder = begun("--instrument", f"tracker={LASER}")
    plan = campaigns.open_(folder).plan
    wanted = plan.instruments[0].in_base(plan.to_base, plan.points.modelled_mm)
    np.testing.assert_allclose(plan.covariance_mm2, wanted, rtol=1e-5, atol=1e-9)
    sizes = np.trace(plan.covariance_mm2, axis1=1, axis2=2)
    assert sizes.max() > 1.05 * sizes.min()
    order = plan.visiting(frozenset())
    told = plan.candidates(order).covariance_mm2
    np.testing.assert_array_equal(told, plan.covariance_mm2[order])


def test_the_beam_of_a_tracker_that_is_turned_against_the_base_is_along_its_line_of_sight():
    (tracker,) = instruments([f"tracker={LASER}"], "instrument")
    turn, head = Rotation.random(rng=4).as_matrix(), np.array([2000.0, -500.0, 300.0])
    at = np.random.default_rng(4).uniform(-800.0, 800.0, (5, 3))
    wanted = [turn @ of_spherical_readings(turn.T @ (each - head)) @ turn.T for each in at]
    np.testing.assert_allclose(tracker.in_base(Pose(turn, head), at), wanted, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("laser:0.01,0.02", "0.01"),
        ("laser:range_mm=-1,angle_mm=0.1,repeat_mm=0", "range_mm"),
        ("laser:angle_mm=0.1,repeat_mm=0", "above 0"),
        ("laser:range_mm=0.1,angle_mm=0.1", "repeat_mm"),
        ("laser:range_mm=0.1,range_mm=0.2,angle_mm=0.1,repeat_mm=0", "twice"),
    ],
)
def test_a_laser_tracker_stated_wrongly_is_refused(text, key):
    with pytest.raises(InputError) as caught:
        instruments([f"tracker={text}", "camera=0"], "instrument")
    tracker, camera = caught.value.problems
    assert key in tracker.what
    assert camera.where == "noise of camera"


def test_a_noise_below_the_rounding_of_the_readings_is_taken_as_the_rounding(begun):
    plan = campaigns.open_(begun("--noise-mm", "0.001,0.001,0.2", "--resolution-mm", 0.1)).plan
    device = plan.instruments[0]
    for used in (device, device.of_reading("0.001,0.001,0.2")):
        std = np.sqrt(np.diag(used.covariance_mm2))
        np.testing.assert_allclose(std, [0.1 / np.sqrt(12), 0.1 / np.sqrt(12), 0.2])
