"""Values for controllers: known errors come back in the controller's names, files can be read."""

import json

import numpy as np
import yaml
from command_line import call
from lxml import etree
from oracles.controllers.arms import ARMS
from scipy.spatial.transform import Rotation
from simulated_cells import calibrated


def exported(results, maker):
    """The answer as JSON, values by group, and the files."""
    target = results.parent / maker
    done = call("export", results, "--for", maker, "--out", target, "--json")
    assert done.exit_code == 0, done.output
    answer, groups = json.loads(done.output), {}
    for each in answer["values"]:
        groups.setdefault(each["group"], {})[each["name"]] = each["new"]
    return answer, groups, target


def ends(rows, q):
    """Positions at joints of a chain of rows theta, d, a, alpha, beta (mm)."""
    here = np.eye(4)
    for (theta, d, a, alpha, beta), angle in zip(rows, q, strict=True):
        step = np.eye(4)
        turned = Rotation.from_euler("ZXY", [angle + theta, alpha, beta])
        step[:3, :3] = turned.as_matrix()
        step[:3, 3] = a * np.cos(angle + theta), a * np.sin(angle + theta), d
        here = here @ step
    return here


def test_ur_staubli_and_ros_describe_the_same_arm():
    """Common normals hundreds of metres away, offsets with a turn about y, and joint origins."""
    arm, rng = ARMS["ur"], np.random.default_rng(3)
    nominal = np.array([[np.deg2rad(t), d, a, np.deg2rad(al), 0.0] for t, d, a, al in arm.rows])
    by_ur, by_staubli, by_ros = (
        exported(calibrated("ur"), each) for each in ("ur", "staubli", "ros")
    )
    deltas = np.array([*by_ur[1]["DH deltas"].values()]).reshape(4, 6).T
    theta, a, d, alpha = deltas.T
    normals = nominal + np.stack([theta, 1e3 * d, 1e3 * a, alpha, 0.0 * d], axis=1)
    conf = dict(
        line.split(" = ") for line in (by_ur[2] / "arm_ur.conf").read_text().split("\n")[1:5]
    )
    np.testing.assert_allclose(json.loads(conf["delta_d"]), d, rtol=0, atol=1e-12)
    assert np.abs(d).max() > 1.0
    offsets = [
        dict(each.attrib) for each in etree.parse(by_staubli[2] / "arm_staubli.cfx").getroot()
    ]
    assert [each.pop("index") for each in offsets] == list("012345")
    units = {"d": 1.0, "a": 1.0, "b": 1.0}
    names = ("theta", "d", "a", "alpha", "beta")
    rows = [[units.get(k, np.pi / 180.0) * float(each[k]) for k in names] for each in offsets]
    links = yaml.safe_load((by_ros[2] / "arm_ros.yaml").read_text())["kinematics"]
    assert {"shoulder", "upper_arm", "wrist_3"} < set(links)
    for q in rng.uniform(-3.0, 3.0, (5, 6)):
        expected, here = ends(nominal + np.array(rows), q), np.eye(4)
        np.testing.assert_allclose(ends(normals, q), expected, rtol=0, atol=1e-5)
        for angle, (name, link) in zip([*q, None], links.items(), strict=True):
            if name == "hash":
                break
            origin = np.eye(4)
            origin[:3, 3] = [1e3 * link[axis] for axis in "xyz"]
            turn = Rotation.from_euler("xyz", [link[k] for k in ("roll", "pitch", "yaw")])
            origin[:3, :3] = (turn * Rotation.from_euler("z", angle)).as_matrix()
            here = here @ origin
        np.testing.assert_allclose(here, expected, rtol=0, atol=1e-5)
    assert by_ur[0]["errors"][0]["position_mm"] < 1.02 * by_ur[0]["errors"][1]["position_mm"]


def test_a_table_or_joints_that_a_controller_does_not_have_are_refused(tmp_path):
    ur, fanuc = calibrated("ur"), calibrated("fanuc")
    done = call("export", ur, "--for", "kuka", "--out", tmp_path)
    assert done.exit_code == 0
    assert call("export", ur, "--for", "kuka", "--out", tmp_path).exit_code == 2
    for maker in ("ur", "staubli", "ros"):
        assert call("export", fanuc, "--for", maker, "--out", tmp_path).exit_code == 2
