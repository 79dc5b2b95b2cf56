"""What a rule or a command does: read artefacts, call the package, hand back tables.

Every module is one stage with a function ``run(inputs, settings) -> tables``.
"""
