"""Every table of a finished study recomputed from the Parquet files before it, by the contract."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
from oracles import assessors, fits, kinematics, maps, small_study, tables, worlds

SEED = 4711
WEIGHT = 500.0
THRESHOLD = 1e-4
DH_UNIT = np.tile([1e-3, 1.0, 1.0, 1e-3], 6)
DH_FREE = np.tile([True, True, True, True, False], 6)
STATISTICS = ("mean", "max", "rms", "gamma99")
PAPER = {
    ("table1", "vec_vs_measured", "position"): (0.705, 1.635, 1.731),
    ("table1", "vec_vs_measured", "orientation"): (1.487, 3.149, 3.248),
    ("table3", "dh_vs_vec", "position"): (0.405, 0.847, 0.918),
    ("table3", "dh_vs_vec", "orientation"): (1.336, 2.851, 2.866),
}


@pytest.fixture(scope="module")
def measurements(finished):
    return tables.rows(finished, "measurements")


@pytest.fixture(scope="module")
def models(finished):
    return tables.models(finished)


# --- measurements and fits ------------------------------------------------------------------------


def test_folds_keep_a_configuration_together_and_name_the_validation_rows(measurements):
    assert len(measurements) >= 160
    fold_of = {}
    for row in measurements:
        key = tuple(round(q, 9) for q in tables.joints(row))
        assert fold_of.setdefault(key, row["fold"]) == row["fold"]
        assert row["subset"] == ("validation" if row["fold"] == 1 else "train")
    sizes = [list(fold_of.values()).count(fold) for fold in range(4)]
    assert max(sizes) - min(sizes) <= 1


def test_frames_of_the_synthetic_arm_are_its_own(models):
    assert {model for model, _ in models.frames} == {"vec", "dh", "nominal"}
    for frame in models.frames.values():
        np.testing.assert_allclose(frame, np.eye(4), rtol=0, atol=1e-12)


def test_the_vec_acts_on_the_nominal_arm_and_covers_the_measured_joints(models, measurements):
    np.testing.assert_allclose(
        np.array(models.nominal), np.array(kinematics.MH180), rtol=0, atol=1e-12
    )
    for row in models.vec:
        q = [tables.joints(m)[row["joint"] - 1] for m in measurements]
        assert row["q_min_rad"] <= min(q)
        assert row["q_max_rad"] >= max(q)


def test_dh_model_is_the_least_squares_fit_to_the_vec_at_the_training_poses(models, measurements):
    train = [row for row in measurements if row["subset"] == "train"]
    q = [tables.joints(row) for row in train]
    wanted = [models.flange("vec", tables.joints(r), tables.directions(r)) for r in train]
    nominal = np.array(models.nominal).ravel()

    def function(x):
        table = nominal.copy()
        table[DH_FREE] = x
        table = table.reshape(6, 5)
        return fits.residual(lambda i: kinematics.dh_forward(table, q[i]), wanted, WEIGHT)

    found = np.array(models.dh).ravel()
    # At the optimum one more step from there leads nowhere.
    expected = fits.truncated_fit(
        function, nominal[DH_FREE], DH_UNIT, THRESHOLD, start=found[DH_FREE], iterations=1
    )
    assert not found[~DH_FREE].any()
    assert np.abs((found[DH_FREE] - expected["x"]) / DH_UNIT).max() < 1e-4


# --- residuals ------------------------------------------------------------------------------------


def pooled(rows, comparison, subset, quantity, fold=None):
    chosen = [
        row
        for row in rows
        if (row["comparison"], row["subset"], row["quantity"], row["fold"])
        == (comparison, subset, quantity, fold)
    ]
    assert len(chosen) == 1
    return chosen[0]


COMPARISONS = ["vec_vs_measured", "dh_vs_vec", "dh_vs_measured", "nominal_vs_measured"]


@pytest.mark.parametrize("comparison", COMPARISONS)
def test_training_residuals(finished, models, measurements, comparison):
    rows = tables.rows(finished, "residuals")
    train = [row for row in measurements if row["subset"] == "train"]
    both = tables.magnitudes(models, train, comparison)
    for quantity, unit, values in zip(
        ("position", "orientation"), ("mm", "mrad"), both, strict=True
    ):
        row = pooled(rows, comparison, "train", quantity)
        assert (row["n"], row["unit"]) == (len(values), unit)
        expected = tables.statistics(values)
        for name in STATISTICS:
            assert row[name] == pytest.approx(expected[name], rel=1e-7)


@pytest.mark.parametrize("comparison", COMPARISONS)
def test_validation_residuals_are_statistics_of_the_held_out_errors(
    finished, models, measurements, comparison
):
    residuals = tables.rows(finished, "residuals")
    errors = [
        row
        for row in tables.rows(finished, "pose_errors")
        if (row["comparison"], row["estimate"]) == (comparison, "cross_validated")
    ]
    assert sorted(row["row"] for row in errors) == list(range(len(measurements)))
    for quantity, columns in (
        ("position", ("ex_mm", "ey_mm", "ez_mm")),
        ("orientation", ("rx_mrad", "ry_mrad", "rz_mrad")),
    ):
        sizes = defaultdict(list)
        for row in errors:
            assert row["fold"] == measurements[row["row"]]["fold"]
            size = math.sqrt(math.fsum(row[c] ** 2 for c in columns))
            sizes[row["fold"]].append(size)
            sizes[None].append(size)
        for fold in {row["fold"] for row in residuals if row["subset"] == "validation"}:
            row = pooled(residuals, comparison, "validation", quantity, fold)
            assert row["n"] == len(sizes[fold])
            expected = tables.statistics(sizes[fold])
            for name in STATISTICS:
                assert row[name] == pytest.approx(expected[name], rel=1e-7)
    # The held-out fold of the delivered models can be recomputed from the models themselves.
    for row in errors:
        if row["fold"] != 1:
            continue
        position, turn = tables.magnitudes(models, [measurements[row["row"]]], comparison)
        found = math.dist((row["ex_mm"], row["ey_mm"], row["ez_mm"]), (0, 0, 0))
        assert found == pytest.approx(position[0], abs=1e-8)
        found = math.dist((row["rx_mrad"], row["ry_mrad"], row["rz_mrad"]), (0, 0, 0))
        assert found == pytest.approx(turn[0], abs=1e-8)


def test_training_error_vectors_are_in_the_robot_base(finished, models, measurements):
    seen = 0
    for row in tables.rows(finished, "pose_errors"):
        if row["estimate"] != "train" or row["row"] % 7:
            continue
        source = measurements[row["row"]]
        left, right = row["comparison"].split("_vs_")
        q, s = tables.joints(source), tables.directions(source)
        first = models.tool(left, q, s, source["target"])
        if right == "measured":
            reading, _ = tables.measured_frame(source)
            second = np.linalg.inv(models.frames[left, "base"]) @ reading
        else:
            second = models.tool(right, q, s, source["target"])
        gap = second[:3, 3] - first[:3, 3]
        found = np.array([row["ex_mm"], row["ey_mm"], row["ez_mm"]])
        # Truth minus model: the sign assessment_points states.
        np.testing.assert_allclose(found, gap, rtol=0, atol=1e-8)
        seen += 1
    assert seen >= 4 * 15


# --- accuracy map and assessment points -----------------------------------------------------------


def arms(models) -> maps.Arms:
    order = max(row["order"] for row in models.vec)
    series, offsets = np.zeros((6, 6, order + 1)), np.zeros((6, 2))
    low, high = np.zeros(6), np.zeros(6)
    for row in models.vec:
        i = row["joint"] - 1
        low[i], high[i] = row["q_min_rad"], row["q_max_rad"]
        if row["direction"] == 0:
            j = kinematics.ERROR_NAMES.index(row["error"])
            series[i, j, row["order"]] = row["coefficient"]
        else:
            assert (row["error"], row["order"]) == ("eps_z", 0)
            offsets[i, 0 if row["direction"] < 0 else 1] = row["coefficient"]
    return maps.Arms(
        dh=np.array(models.dh),
        nominal=np.array(models.nominal),
        series=series,
        low=low,
        high=high,
        dh_tool=models.frames["dh", "tool"],
        true_tool=models.frames["vec", "tool"],
        s=(0,) * 6,
        offsets=offsets,
    )


def test_map_cells(finished, models):
    rows = tables.rows(finished, "accuracy_map")
    assert len(rows) == 2 * 5 * 4
    assert {row["slice_deg"] for row in rows} == {0.0, 30.0}
    reference = kinematics.rot_x(math.pi)[:3, :3]
    limits = np.radians(kinematics.MH180_LIMITS_DEG).T
    reached = [row for row in rows if row["solutions"] > 0]
    assert reached
    for row in [
        *reached[:: max(1, len(reached) // 4)],
        *[r for r in rows if not r["solutions"]][:1],
    ]:
        assert row["wanted"] == 18
        position, turn, name, count = maps.cell(
            arms(models),
            limits,
            math.radians(row["slice_deg"]),
            row["radius_mm"],
            row["height_mm"],
            reference,
            math.radians(45),
        )
        assert row["solutions"] == count
        assert row["worst_branch"] == name
        if count:
            assert row["position_max_mm"] == pytest.approx(position, abs=1e-6)
            assert row["orientation_max_mrad"] == pytest.approx(turn, abs=1e-6)
        else:
            assert row["position_max_mm"] is None
            assert row["orientation_max_mrad"] is None


def test_assessment_points(finished, models):
    rows = tables.rows(finished, "assessment_points")
    assert [row["point"] for row in rows] == list(range(24))
    for row in rows:
        q, s = tables.joints(row), tables.directions(row)
        assert s == [0] * 6
        gap = models.tool("vec", q, s)[:3, 3] - models.tool("dh", q, s)[:3, 3]
        np.testing.assert_allclose(
            [row["ex_mm"], row["ey_mm"], row["ez_mm"]], gap, rtol=0, atol=1e-9
        )
        assert row["true_error_mm"] == pytest.approx(np.linalg.norm(gap), abs=1e-9)
        x, y, z = models.tool("dh", q, s)[:3, 3]
        assert 1200 - 1e-6 <= math.hypot(x, y) <= 2100 + 1e-6
        assert -1e-9 <= math.atan2(y, x) <= math.radians(60) + 1e-9
        assert -1e-6 <= z <= 500 + 1e-6


# --- study ----------------------------------------------------------------------------------------


def true_errors(finished) -> np.ndarray:
    rows = tables.rows(finished, "assessment_points")
    return np.array([[row["ex_mm"], row["ey_mm"], row["ez_mm"]] for row in rows])


def test_study_rows_follow_from_the_assessment_points_and_the_seed(finished):
    error = true_errors(finished)
    rows = tables.rows(finished, "study")
    assert len(rows) == 2 * 3 * 3
    for row in rows:
        noise = row["noise_mm"]
        reading = worlds.simulation(error.tolist(), noise, row["repetition"], SEED)
        sizes = [assessors.norm(reading(j, 1)) for j in range(24)]
        if row["assessor"] == "maximum":
            expected = assessors.maximum(sizes)
        elif row["assessor"] == "outlier_rejection":
            expected = assessors.outlier_rejection(sizes, "normal")
        else:
            expected = row["assessed_mm"]
            k = round(expected * 1000)
            assert expected == pytest.approx(k / 1000, abs=1e-12)

            def rejects(bound, reading=reading, noise=noise):
                return assessors.invalidation_run(
                    reading, range(24), [noise] * 24, bound / 1000, 24
                ).rejected

            assert rejects(k - 1)
            assert not any(rejects(b) for b in range(k, math.ceil(max(sizes) * 1000) + 1, 5))
        assert row["assessed_mm"] == pytest.approx(expected, rel=1e-10)


def test_summary_is_about_the_study_and_the_largest_true_error(finished):
    truth = max(assessors.norm(e) for e in true_errors(finished).tolist())
    study = tables.rows(finished, "study")
    summary = tables.rows(finished, "study_summary")
    assert len(summary) == 3 * 2
    for row in summary:
        values = [
            r["assessed_mm"]
            for r in study
            if (r["assessor"], r["noise_mm"]) == (row["assessor"], row["noise_mm"])
        ]
        assert row["repetitions"] == len(values) == 3
        mean = math.fsum(values) / 3
        assert row["mean_mm"] == pytest.approx(mean, rel=1e-12)
        assert (row["min_mm"], row["max_mm"]) == (min(values), max(values))
        assert row["bias_mm"] == pytest.approx(mean - truth, abs=1e-12)
        rmse = math.sqrt(math.fsum((v - truth) ** 2 for v in values) / 3)
        assert row["rmse_mm"] == pytest.approx(rmse, rel=1e-10)
    readings = tables.rows(finished, "readings")
    assert len(readings) == 2 * 15
    default = {
        "outlier_rejection": ("normal", None, None, None),
        "model_invalidation": (None, "squared", "r", "from_above"),
    }
    for row in readings:
        switches = tuple(row[n] for n in ("outlier_rule", "distance", "covariance", "search"))
        if switches == default[row["assessor"]]:
            same = [
                r
                for r in summary
                if (r["assessor"], r["noise_mm"]) == (row["assessor"], row["noise_mm"])
            ]
            for name in ("mean_mm", "min_mm", "max_mm", "bias_mm"):
                assert row[name] == same[0][name]


def test_histories_are_runs_of_the_studys_worlds(finished):
    error = true_errors(finished)
    sizes = [assessors.norm(e) for e in error.tolist()]
    shown = defaultdict(list)
    for row in tables.rows(finished, "histories"):
        shown[row["example"]].append(row)
    assert {"rejected", "not_rejected"} <= set(shown)
    for rows in shown.values():
        eta, noise = rows[0]["eta_mm"], rows[0]["noise_mm"]
        for repetition in range(30):
            reading = worlds.simulation(error.tolist(), noise, repetition, SEED)
            if assessors.norm(reading(rows[0]["point"], 1)) == pytest.approx(
                rows[0]["measured_mm"], abs=1e-10
            ):
                break
        else:
            pytest.fail("no simulation of the study shows this history")
        run = assessors.invalidation_run(reading, range(24), [noise] * 24, eta, 24)
        assert len(run.steps) == len(rows)
        for row, step in zip(rows, run.steps, strict=True):
            assert (row["point"], row["repeat"]) == (step.point, step.repeat)
            assert row["averaged_mm"] == pytest.approx(step.averaged, abs=1e-10)
            assert row["true_mm"] == pytest.approx(sizes[step.point], abs=1e-10)
            assert row["rejection_probability"] == pytest.approx(step.probability, abs=1e-9)


# --- claims ---------------------------------------------------------------------------------------


def test_numbers_of_the_claims(papers_arm):
    models = tables.models(papers_arm)
    measurements = tables.rows(papers_arm, "measurements")
    claims = {row["claim"]: row for row in tables.rows(papers_arm, "claims")}
    train = [row for row in measurements if row["subset"] == "train"]
    for (table, comparison, quantity), paper in PAPER.items():
        both = tables.magnitudes(models, train, comparison)
        expected = tables.statistics(both[quantity == "orientation"])
        for name, value in zip(("mean", "max", "gamma99"), paper, strict=True):
            row = claims[f"{table}_{quantity}_{name}"]
            assert row["paper"] == value
            assert row["tolerance"] == pytest.approx(value / 10, rel=1e-12)
            assert row["reproduced"] == pytest.approx(expected[name], rel=1e-7)
            agrees = abs(row["reproduced"] - value) <= value / 10
            assert row["verdict"] == ("agrees" if agrees else "differs")
    truth = max(assessors.norm(e) for e in true_errors(papers_arm).tolist())
    assert claims["true_accuracy"]["paper"] == 0.906
    assert claims["true_accuracy"]["reproduced"] == pytest.approx(truth, rel=1e-12)
    d = [row[1] for row in models.dh]
    pair = claims["table2_d_2_minus_d_3"]
    assert pair["paper"] == pytest.approx(-0.964)
    assert pair["reproduced"] == pytest.approx(d[1] - d[2], abs=1e-12)
    for joint in (2, 3):
        assert claims[f"table2_d_{joint}"]["verdict"] == "not comparable"
    fifth = claims["table2_theta_offset_5"]
    assert fifth["paper"] == pytest.approx(-3.141)
    assert math.cos(fifth["reproduced"] - models.dh[4][0]) == pytest.approx(1, abs=1e-12)


# --- measured files and folds ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def other_fold(tmp_path_factory, written):
    """The study of the written file with fold 2 held out of the delivered models."""
    folder = tmp_path_factory.mktemp("other")
    config = folder / "config.yaml"
    settings = small_study.SETTINGS % ("file", written[0])
    config.write_text(settings.replace("validation_fold: 1", "validation_fold: 2"), "utf-8")
    stages = ("measurements", "vec", "dh", "residuals")
    return small_study.run_stages(config, "small", folder / "results", stages)


def test_a_written_file_is_read_back(other_fold, written):
    rows = tables.rows(other_fold, "measurements")
    assert len(rows) == len(written[1].q_rad)
    for row, q, frame in zip(rows, written[1].q_rad, written[1].frames, strict=True):
        np.testing.assert_allclose(tables.joints(row), q, rtol=0, atol=1e-12)
        reading, full = tables.measured_frame(row)
        assert full
        assert row["qw"] >= 0
        np.testing.assert_allclose(reading, frame, rtol=0, atol=1e-12)
        assert tables.directions(row) == [0] * 6
    # Every fifteenth pose is revisited at the end: in the same fold, whichever that is.
    for first, again in zip(rows[:150:15], rows[150:], strict=True):
        assert first["fold"] == again["fold"]


def test_cross_validated_errors_are_those_of_models_that_never_saw_the_fold(
    other_fold, tmp_path_factory, written
):
    folder = tmp_path_factory.mktemp("this")
    config = folder / "config.yaml"
    config.write_text(small_study.SETTINGS % ("file", written[0]), "utf-8")
    stages = ("measurements", "vec", "dh", "residuals")
    here = small_study.run_stages(config, "small", folder / "results", stages)
    rows = tables.rows(here, "measurements")
    assert [r["fold"] for r in rows] == [r["fold"] for r in tables.rows(other_fold, "measurements")]
    unseen = tables.models(other_fold)
    checked = 0
    for row in tables.rows(here, "pose_errors"):
        if (row["estimate"], row["fold"]) != ("cross_validated", 2):
            continue
        source = rows[row["row"]]
        position, turn = tables.magnitudes(unseen, [source], row["comparison"])
        found = math.dist((row["ex_mm"], row["ey_mm"], row["ez_mm"]), (0, 0, 0))
        assert found == pytest.approx(position[0], abs=1e-6)
        found = math.dist((row["rx_mrad"], row["ry_mrad"], row["rz_mrad"]), (0, 0, 0))
        assert found == pytest.approx(turn[0], abs=1e-6)
        checked += 1
    assert checked >= 4 * 35
