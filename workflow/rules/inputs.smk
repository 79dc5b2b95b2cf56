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
    return plan.waited_for(name, dataset, part, ancient) | files
