"""What a rule or a command does: read artefacts, call the package, hand back tables.

``catalogue`` lists the stages, ``runner`` runs one; every other module is one stage with a function
``run(inputs, settings) -> tables``. A stage neither computes nor touches files.
"""

import os

# Set before numpy is first imported: more BLAS threads change the last bits of a sum.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"):
    os.environ[_name] = "1"
