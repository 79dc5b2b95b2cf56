"""The page of a data set as a reader meets it: opened in Chromium, clicked, printed."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from chromium import PHONE, Chromium
from stages_by_hand import STUDIED, run_stages

SMALL = """\
datasets: {small: {robot: mh180}}
measurements: {folds: 2, synthetic: {poses: 60}}
calibration: {vec: {order: 2}}
evaluation: {points: 12}
map: {slices_deg: [0, 30], grid_mm: 300}
study: {noise_mm: [0.1, 0.3], repetitions: 3, measurements: 12}
histories: {simulations_searched: 10}
"""
MOST_BYTES = 4_000_000
HOSTILE = (
    "<script>window.ran = 1</script>",
    "</script><img src=x onerror='window.ran = 2'>",
    "\"'><b onmouseover=window.ran=3>",
    "{{ 7 * 7 }} {% raw %} ${7*7}",
    "two\u2028lines & more",
)


@pytest.fixture(scope="session")
def chromium():
    browser = Chromium()
    yield browser
    browser.driver.quit()


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """Results of a small study of the paper's arm: every section of the page has its tables."""
    base = tmp_path_factory.mktemp("small")
    (base / "small.yaml").write_text(SMALL)
    return run_stages(STUDIED, [base / "small.yaml"], base / "results")


@pytest.fixture(scope="session")
def path(folder) -> Path:
    from kinacc.cli.results import written

    return written(str(folder))


def test_every_chart_is_drawn_and_its_controls_change_it(chromium, path):
    assert path.stat().st_size < MOST_BYTES
    with chromium.opened(path) as page:
        found = page.run("""
            const charts = document.querySelectorAll(".chart");
            const [index] = [Object.values(Bokeh.index)];
            const views = [...Bokeh.index.roots ?? index];
            const models = views.flatMap((view) => [...view.model.references()]);
            const select = (title) =>
              models.find((each) => each.type === "Select" && each.title === title);
            const slice = select("Slice"), joint = select("Joint");
            slice.value = slice.options[1];
            joint.value = joint.options[2];
            await new Promise((go) => setTimeout(go, 300));
            const groups = models.filter((each) => each.type === "GroupFilter");
            const axes = models.filter((each) => each.type === "LinearAxis");
            return {
              charts: charts.length,
              empty: [...charts].filter((each) => each.children.length === 0).length,
              slice: [slice.value, ...groups.map((each) => each.group)],
              joint: [joint.value, axes.filter((each) => each.axis_label === joint.value).length],
            };
        """)
    assert (found["charts"], found["empty"]) == (2, 0)
    assert found["slice"] == ["30 deg", "30 deg"]
    assert found["joint"] == ["J3, deg", 1]


@pytest.mark.parametrize("dark", [False, True])
def test_on_a_phone_nothing_stands_out_to_the_side(chromium, path, dark):
    with chromium.opened(path, PHONE, dark) as page:
        wide = page.run("""
            document.querySelectorAll("details").forEach((each) => { each.open = true; });
            const out = [...document.querySelectorAll("body *")].filter((each) =>
              !each.parentElement.closest(".wide") && each.getBoundingClientRect().right > 391);
            const cut = [...document.querySelectorAll(".wide")].filter((each) =>
              each.scrollWidth > each.clientWidth);
            return [document.documentElement.scrollWidth,
              ...[...out, ...cut].map((each) => each.outerHTML)];
        """)
    assert wide == [PHONE[0]]


def test_on_paper_nothing_is_there_to_be_clicked_and_pictures_are_printed(chromium, path):
    with chromium.opened(path, dark=True) as page:
        told = page.command("Page.printToPDF", printBackground=True, preferCSSPageSize=True)
        page.show((688, 1017), dark=True, media="print")
        seen = page.run("""
            return {
              ink: getComputedStyle(document.body).color,
              width: document.documentElement.scrollWidth,
            };
        """)
    pdf = base64.b64decode(told["data"])
    sizes = {tuple(map(float, each)) for each in re.findall(rb"/MediaBox \[0 0 (\S+) (\S+)\]", pdf)}
    assert {tuple(map(round, each)) for each in sizes} == {(595, 842)}
    assert seen["ink"] == "rgb(0, 0, 0)"
    assert seen["width"] <= 688


def test_names_that_look_like_code_are_shown_and_never_run(chromium, folder, tmp_path):
    from kinacc.deployment.folder import read_tables
    from kinacc.report import dataset
    from kinacc.report.page import html
    from kinacc.report.summarise import ON_PAGE, PAGE_TABLES

    tables = dict(read_tables(folder, needed=PAGE_TABLES, optional=ON_PAGE))
    targets = np.resize(np.array(HOSTILE, dtype=object), len(tables["measurements"]["target"]))
    tables["measurements"] = {**tables["measurements"], "target": targets}
    name = " ".join(HOSTILE)
    made = dataset.run(tables, name)
    page_file = tmp_path / "hostile.html"
    page_file.write_text(html(made, {"seed": name}), encoding="utf-8")
    with chromium.opened(page_file) as page:
        found = page.run("""
            return {text: document.body.innerText, ran: window.ran ?? null,
              strays: document.querySelectorAll("img[src=x], b").length};
        """)
    assert found["ran"] is None
    assert found["strays"] == 0
    assert HOSTILE[0] in found["text"]
