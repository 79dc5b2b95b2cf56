# What rules ask for when Snakemake plans.


# The targets are not known yet when this file is read.
def with_robustness():
    return "robustness" in workflow.dag_settings.targets


# Files from outside are read where they stand, also where results go to a storage.
def files_read(name, dataset, part):
    files = {
        role: local(paths) if role.endswith("_file") else paths
        for role, paths in plan.inputs(name, dataset, with_robustness()).items()
    }
    waited_for = plan.waited_for(name, dataset, part, ancient)
    if workflow.storage_settings.default_storage_provider is not None:
        # A job has of a storage what is named alone; elsewhere records stand beside the tables.
        waited_for["records"] = plan.records_read(name, dataset)
    return waited_for | files


# What `snakemake --list-target-rules` says of the step before it, as no text can stand in a loop.
def listed_as(words):
    next(reversed(workflow.rules)).docstring = words
