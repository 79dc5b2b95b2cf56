"""What is gone is answered by one line that names what to do instead, with exit code 2."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from kinacc import removed
from kinacc.campaign.plan import _kept_assessor
from kinacc.cli.group import main
from kinacc.config.load import load
from kinacc.errors import InputError

PLACES = {"campaign": ["campaign", "start", "check"]}


@pytest.mark.parametrize("command", removed.COMMANDS)
def test_a_command(command):
    done = CliRunner().invoke(main, [command, "results"])
    assert done.exit_code == 2
    assert removed.COMMANDS[command] in done.output


@pytest.mark.parametrize(
    ("command", "option"),
    [(command, option) for command, options in removed.OPTIONS.items() for option in options],
)
def test_an_option(command, option):
    done = CliRunner().invoke(main, [*PLACES.get(command, [command]), option])
    assert done.exit_code == 2
    assert removed.OPTIONS[command][option] in done.output


@pytest.mark.parametrize("key", removed.KEYS)
def test_a_key(key):
    with pytest.raises(InputError) as caught:
        load([], {"datasets": {"mh180": {"robot": "mh180", key: {}}}})
    assert [each.fix for each in caught.value.problems] == [removed.KEYS[key]]


@pytest.mark.parametrize("setting", removed.SETTINGS)
def test_a_setting_of_a_campaign_begun_before(setting):
    budget = {"measurements": 40}
    former = _kept_assessor("search_and_confirm", budget | removed.SETTINGS)
    assert former == _kept_assessor("search_and_confirm", budget)
    with pytest.raises(InputError, match=setting):
        _kept_assessor("search_and_confirm", budget | {setting: "other"})
