# The tournament of assessors over all data sets: `snakemake -c2 tournament`, made on request.
from kinacc.workflow.tournament_plan import tournament_plan

contest = tournament_plan(plan)


rule tournament_chunk:
    input:
        list(contest.inputs.values()),
    output:
        contest.chunk("{part}"),
    log:
        contest.chunk_job("{part}").log,
    conda:
        "../envs/kinacc.yaml"
    params:
        code=contest.code(contest.chunk_job("1-of-1")),
        inputs=contest.inputs,
        outputs=lambda w: contest.chunk_job(w.part).outputs,
        part="{part}",
        seed=contest.seed,
        settings=contest.settings,
    message:
        "tournament: campaigns of every assessor, part {wildcards.part}"
    script:
        "../scripts/tournament_chunk.py"


rule tournament:
    input:
        list(contest.inputs.values()),
        contest.chunks,
    output:
        list(contest.outputs.values()),
    log:
        contest.tables_job().log,
    conda:
        "../envs/kinacc.yaml"
    params:
        code=contest.code(contest.tables_job()),
        inputs=contest.tables_job().inputs,
        outputs=contest.outputs,
        seed=contest.seed,
        settings=contest.settings,
    message:
        "tournament: gathering the cells and judging every assessor"
    script:
        "../scripts/tournament.py"
