"""Temporary: the comparison by its function, until the command has it."""

import shutil
from dataclasses import asdict, is_dataclass

import worlds


def plain(o):
    if hasattr(o, "__dataclass_fields__"):
        return {k: plain(getattr(o, k)) for k in o.__dataclass_fields__}
    if isinstance(o, (list, tuple)):
        return [plain(x) for x in o]
    if hasattr(o, "items"):
        return {k: plain(v) for k, v in o.items()}
    return o


def gate(self, *options):
    from kinacc.gate.golden import compared
    from kinacc.workflow.verification.check import check_results, check_dataset
    import kinacc.workflow.verification.check as c

    outs = plain(
        compared(self.results, self.accepted, list(self.plan().datasets), "--exact" in options)
    )
    return worlds.Answer(int(any(o["verdict"] == "failed" for o in outs)), {"outcomes": outs}, "")


def accept(self):
    shutil.copytree(self.results, self.accepted)


worlds.World.gate = gate
worlds.World.accept = accept
worlds.GATES = ""
