# configuration -> validate -> plan -> rules -> everything the data sets leave behind
import os
import re
import shlex
import sys

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

# Snakemake imports pandas (0.5 s of every start) only to compare parameters that are data frames.
sys.modules.setdefault("pandas", None)

# Snakemake writes this path into shell commands as it is; a folder may have a space in its name.
sys.executable = shlex.quote(sys.executable)

from kinacc.errors import InputError
from kinacc.workflow.catalogue import STAGES, TOURNAMENT
from kinacc.workflow.plan import label, planned

try:
    # Started from a folder without a config.yaml, the study is that of this file's folder.
    default = "config.yaml" if os.path.isfile("config.yaml") else f"{workflow.basedir}/config.yaml"
    plan = planned(workflow.configfiles or [default], workflow.config_settings.config)
    plan.check_files()
except InputError as error:
    raise WorkflowError(str(error)) from None
for dataset in plan.datasets:
    for stage, reason in plan.left_out(dataset).items():
        if not STAGES[stage].measured and not STAGES[stage].fits:
            logger.info(f"{dataset}: {stage} is left out, {reason}")


wildcard_constraints:
    dataset="|".join(map(re.escape, plan.datasets)),
    part=r"\d+-of-\d+",


rule all:
    input:
        [plan.targets(dataset) for dataset in plan.datasets],
    message:
        "every table and figure is up to date"


include: "workflow/rules/stages.smk"


onsuccess:
    for told in plan.remarks():
        logger.info(told)
