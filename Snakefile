# The workflow stands in workflow/Snakefile, where the workflow catalogue looks for it.
include: "workflow/Snakefile"


# What an included file calls its default target does not count.
rule everything:
    """what a plain `snakemake` makes: all"""
    default_target: True
    input:
        rules.all.input,
    message:
        "every table and figure is up to date"
