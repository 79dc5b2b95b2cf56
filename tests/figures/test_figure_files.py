"""The files of a figure: same bytes every time, vector text, nothing half-written."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import zlib
from io import BytesIO
from pathlib import Path

import figure_tables as tables
import matplotlib
import pytest
from figure_words import figures
from fontTools.ttLib import TTFont
from matplotlib.figure import Figure

from kinacc.errors import InputError
from kinacc.figures import fig1, fig4, save

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def rendered():
    return {name: save.render(figure, save.FORMATS) for name, figure in figures("mh180").items()}


def test_two_drawings_have_the_same_bytes(rendered):
    again = {name: save.render(figure, save.FORMATS) for name, figure in figures("mh180").items()}
    differing = [
        f"{name}.{kind}"
        for name, files in rendered.items()
        for kind in files
        if files[kind] != again[name][kind]
    ]
    assert differing == []


def test_another_process_gives_the_same_bytes(rendered):
    program = (
        "import sys, hashlib; sys.path.insert(0, sys.argv[1])\n"
        "from figure_words import figures\n"
        "from kinacc.figures import save\n"
        "for name, figure in figures('mh180').items():\n"
        "    for kind, content in save.render(figure, save.FORMATS).items():\n"
        "        print(name, kind, hashlib.sha256(content).hexdigest())\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(HERE)],
        env={**os.environ, "PYTHONHASHSEED": "7", "SOURCE_DATE_EPOCH": "1000000000"},
        capture_output=True,
        text=True,
        check=True,
    )
    here = {
        (name, kind, hashlib.sha256(content).hexdigest())
        for name, files in rendered.items()
        for kind, content in files.items()
    }
    assert {tuple(line.split()) for line in done.stdout.splitlines()} == here


def test_surrounding_settings_do_not_matter():
    plain = save.render(fig4.draw(tables.study_summary()), save.FORMATS)
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9, "svg.fonttype": "none"}):
        assert save.render(fig4.draw(tables.study_summary()), save.FORMATS) == plain


def test_files_carry_no_date_and_no_version(rendered):
    for files in rendered.values():
        for content in files.values():
            assert matplotlib.__version__.encode() not in content
            assert not re.search(rb"CreationDate|<dc:date>|tIME|Producer", content)


def test_every_format_order_and_choice_gives_the_same_bytes():
    every = save.render(fig1.draw(), save.FORMATS)
    assert save.render(fig1.draw(), ["pdf"])["pdf"] == every["pdf"]
    assert save.render(fig1.draw(), ["png", "svg"])["svg"] == every["svg"]


def test_vector_files_hold_no_picture_but_the_maps(rendered):
    for name, files in rendered.items():
        assert (b"<image" in files["svg"]) == (name == "fig3")
        assert len(files["svg"]) < 500_000
        assert len(files["pdf"]) < 250_000


def test_a_format_is_drawn_once(monkeypatch):
    drawn = []
    draw = Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda self, renderer: drawn.append(draw(self, renderer)))
    save.render(fig1.draw(), save.FORMATS)
    assert len(drawn) == len(save.FORMATS)


def test_a_pdf_carries_letters_and_not_the_rules_for_setting_text(rendered):
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", rendered["fig4"]["pdf"], re.DOTALL)
    plain = [zlib.decompress(stream) for stream in streams if stream.startswith(b"x")]
    fonts = [TTFont(BytesIO(font)) for font in plain if font.startswith(b"\0\1\0\0")]
    assert fonts
    assert all("glyf" in font and "GPOS" not in font for font in fonts)


def test_a_person_who_draws_keeps_the_help_texts_of_matplotlib():
    program = (
        "import inspect; from kinacc.figures import fig4; from matplotlib.lines import Line2D\n"
        "assert 'linewidth' in inspect.signature(Line2D.set).parameters"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_unknown_formats_are_all_named():
    with pytest.raises(InputError) as error:
        save.render(fig1.draw(), ["svg", "gif", "jpeg"])
    assert len(error.value.problems) == 2


def test_write_leaves_all_or_nothing(tmp_path):
    paths = {kind: tmp_path / "a folder" / f"fig1.{kind}" for kind in save.FORMATS}
    save.write(fig1.draw(), paths)
    assert sorted(p.name for p in (tmp_path / "a folder").iterdir()) == [
        "fig1.pdf",
        "fig1.png",
        "fig1.svg",
    ]
    elsewhere = {"svg": tmp_path / "b" / "fig1.svg", "gif": tmp_path / "b" / "fig1.gif"}
    with pytest.raises(InputError):
        save.write(fig1.draw(), elsewhere)
    assert not (tmp_path / "b").exists()
