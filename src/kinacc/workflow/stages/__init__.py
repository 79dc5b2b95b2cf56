"""What a rule or a command does: read artefacts, call the package, hand back tables.

``catalogue`` lists the stages, ``runner`` runs one; every other module is one stage with a function
``run(inputs, settings) -> tables``. A stage neither computes nor touches files.
"""

import os

from kinacc.starting import ONE_THREAD

os.environ.update(ONE_THREAD)
