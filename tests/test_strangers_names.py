"""Names and texts from strangers: nothing runs, draws, steers or leads anywhere because of them."""

from __future__ import annotations

import csv
import html
import io
import shlex
import xml.etree.ElementTree as ET
from pathlib import Path

import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import call

from kinacc.cli.output import write_table
from kinacc.errors import InputError, Problem
from kinacc.figures.campaign import draw_budgets
from kinacc.figures.save import render
from kinacc.report.terminal import print_table

FORMULAS = ("=1+1", "+1+cmd", "-1+1", "@SUM(1)", "\t=1", "\r=1", "\n=1", "'=1", "＝1", "＠1")
PLAIN = ("-1.5", "+2", "1e-3", "tool", "−3", "a=b", "'", "")


def test_no_cell_of_a_csv_file_is_a_formula_and_numbers_stay_numbers(tmp_path):
    texts = [*FORMULAS, *PLAIN, "behind\r=1"]
    write_table(pd.DataFrame({"=name": texts}), tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_bytes().decode()
    cells = [row[0] if row else "" for row in csv.reader(io.StringIO(text, newline=""))]
    assert not any(cell[:1] in tuple("=@＝＠\t\r\n") or cell == "+1+cmd" for cell in cells)
    assert [cell for cell in cells if cell in PLAIN] == [*PLAIN]


def test_no_cell_of_a_workbook_is_a_formula(tmp_path):
    write_table(pd.DataFrame({"=name": [*FORMULAS, "\x1b[2J"]}), tmp_path / "a.xlsx")
    rows = list(openpyxl.load_workbook(tmp_path / "a.xlsx").active.iter_rows())
    assert all(cell.data_type in "sn" for row in rows for cell in row)
    assert [row[0].value for row in rows[:2]] == ["'=name", "'=1+1"]


@pytest.mark.parametrize("name", ["$\\frac$", "$x$", "_left out", "a--><script>1</script>"])
def test_a_file_of_errors_of_any_name_is_drawn_under_it(name):
    widths = {"width_q05_mm": 0.5, "width_median_mm": 1.0, "width_q95_mm": 3.0}
    rows = pd.DataFrame({"errors": name, "budget": [1, 2], "share": 0.7} | widths)
    figure = draw_budgets(rows, None, None, None)
    medians, shares = (axes.lines[0].get_ydata()[0] for axes in figure.axes)
    assert (medians, shares) == (1.0, 0.7)
    picture = render(figure, ["svg"])["svg"]
    assert not any("script" in each.tag for each in ET.fromstring(picture).iter())
    assert name in html.unescape(picture.decode()).replace("- -", "--")


def test_a_message_does_not_steer_the_terminal_it_is_shown_in(tmp_path):
    said = str(InputError(Problem("a\x1b[2J.csv", "\x9b31m\u202e", "\x07", "two\nlines")))
    assert said.isprintable() or set(said) - set(filter(str.isprintable, said)) == {"\n"}
    name = "\x1b]0;owned\x07.yaml"
    (tmp_path / name).write_text("seed: 1\n")
    done = call("check-data", tmp_path / name)
    assert "\x1b" not in done.output
    assert "\\u001b]0;owned" in done.output


def test_a_table_on_the_screen_does_not_steer_the_terminal(capsys):
    print_table(pd.DataFrame({"\x1b[2Jname": ["\x1b[2Jtool"]}))
    assert "\x1b" not in capsys.readouterr().out


@pytest.mark.parametrize("name", ["$(touch owned)", "a; touch owned", "`touch owned` 'x\"", "a b&"])
def test_a_command_that_is_printed_is_safe_to_paste(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    folder = Path(name) / "own"
    folder.mkdir(parents=True)
    pq.write_table(pa.table({"name": ["own"]}), folder / "robot.parquet")
    for asked, named in ((folder, folder / "robot"), (folder.parent, folder)):
        done = call("show", asked, code=0)
        said = done.output.splitlines()[0].partition("kinacc show ")[2]
        assert shlex.split(said) == [str(named)]
