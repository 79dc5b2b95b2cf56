"""``kinacc add``: new readings of an arm as a further line of its series."""

from __future__ import annotations

import shlex
from dataclasses import asdict

import click

from kinacc.cli.choice import option
from kinacc.cli.output import answers
from kinacc.config.series import MOVED, SAME

_FLAG = click.Choice([SAME, MOVED])


@click.command("add")
@click.argument("measurement_file", metavar="FILE", type=click.Path())
@option("--to", "config", required=True, type=click.Path(), help="Configuration file of the arm.")
@option("--dataset", help="Data set of the configuration; needed if there are several.")
@option("--date", help="Day it was measured, as 2026-06-02. [as times in the file say]")
@option("--base", type=_FLAG, required=True, help="Robot and instrument since the newest line.")
@option("--tool", type=_FLAG, required=True, help="Tool or targets since the newest line.")
@option("--first-date", help="Day of the file that is there, where it is no series yet.")
@answers()
def add(measurement_file, config, dataset, date, base, tool, first_date, out) -> None:
    """Add a measured FILE of the same arm to its series, one more line of the configuration.

    --base and --tool tell whether something was moved since the newest line. Comments stay as
    they are. `kinacc calibrate` then fits the new line and tests whether the arm has changed.

    \b
    Example:
      kinacc add june.csv --to tracker.yaml --date 2026-06-02 --base moved --tool same
    """
    from kinacc.deployment import adding

    result = adding.add(measurement_file, config, base, tool, dataset, date, first_date)
    following = shlex.join(["kinacc", "calibrate", config])
    lines = [f"{config}, series of {result.dataset}:", *(f"  - {line}" for line in result.written)]
    out.say(asdict(result), "\n".join([*lines, f"Next: {following}"]))
