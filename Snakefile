"""kinacc: how large is the largest error of a calibrated robot model?

measurements -> data_check -> fit_vec -> fit_dh -> residuals (Tables I to III) -> summary
    -> accuracy_map (Fig. 3); operating_points -> study_part .. -> study (Fig. 4), histories (Figs. 5, 6) -> claims
    -> figures, map_figure, report, digests

Every data set of the configuration goes through all of it, in results/<data set>/. Tables are
Parquet; units and meanings stand in their metadata. `snakemake -c2` makes everything, `snakemake
-c2 calibration` the models and their errors, `snakemake -c2 robustness` also the claims on further
synthetic arms. `snakemake -c2 --until fit_dh` stops after a stage, `-R fit_dh` makes it anew.
"""

import os
import shlex
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from kinacc.campaign.beside_results import of_results as campaigns_of
from kinacc.errors import InputError
from kinacc.workflow import running
from kinacc.workflow.code import code_digest
from kinacc.workflow.data_sets import CALIBRATION, RESULTS, campaign_files, digests, read_data_sets
from kinacc.workflow.start import job_environment

HERE = str(workflow.current_basedir)
if {*"{}"} & {*HERE}:
    raise WorkflowError("the workflow's folder has braces in its name: rename the folder")
os.environ.update(job_environment(HERE))
if os.path.isfile(sys.executable):  # not quoted yet: Snakemake does not, in the commands of jobs
    sys.executable = shlex.quote(sys.executable)

try:
    if workflow.modifier.namespace:  # a module of another workflow, which hands over `config`
        data = read_data_sets([], config, absolute=True)
    else:
        default = "config.yaml" if os.path.isfile("config.yaml") else os.path.join(HERE, "config.yaml")
        data = read_data_sets(workflow.configfiles or [default], workflow.config_settings.config)
except InputError as error:
    raise WorkflowError(str(error)) from None


wildcard_constraints:
    dataset="|".join(data.settings),


scattergather:
    study=data.parts,


include: "workflow/rules/common.smk"


rule all:  # the first rule, and so the default, unless this is a module below rules of another workflow
    """every table, picture and page of every data set"""
    input:
        [calibration_of(dataset) for dataset in data.settings],
        [[*study_of(dataset), f"{RESULTS}/{dataset}/SHA256SUMS"] for dataset in data.reported],


include: "workflow/rules/calibration.smk"
include: "workflow/rules/assessment.smk"
include: "workflow/rules/pages.smk"


rule calibration:
    """the models of every data set and what is left of the errors"""
    input:
        [calibration_of(dataset) for dataset in data.settings],


rule robustness:
    """everything, and the claims on further synthetic arms, whose shares go into claims.parquet"""
    input:
        rules.all.input,
        [[*tables(dataset, "robustness").values()] for dataset in data.reported if not data.is_measured(dataset)],


onstart:
    if workflow.is_main_process:  # not a job on a cluster
        running.hold(RESULTS)


onsuccess:
    if workflow.is_main_process:
        from kinacc.report.terminal import print_summaries

        print_summaries(running.calibrated(RESULTS, data.reported))
